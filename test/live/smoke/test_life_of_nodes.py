# SPDX-License-Identifier: Apache-2.0
"""Nodes that somebody drives from state to state, as `ros2 lifecycle` and a launch file do; and one that fails."""

import pytest
from failing import ends_with_its_sentence
from lifecycle_msgs.msg import State, Transition
from live_nodes import SLOW, page_path

NODES = {
    "haptic_loopback": {"autostart": False},
    "haptic_driver": {"autostart": False, "auto_enable": True, **SLOW},
    "haptic_simulation": {"autostart": False, "scene": "free_space"},  # its tool is where the handle is
}
UNCONFIGURED, INACTIVE, ACTIVE = (
    State.PRIMARY_STATE_UNCONFIGURED,
    State.PRIMARY_STATE_INACTIVE,
    State.PRIMARY_STATE_ACTIVE,
)


def test_without_autostart_they_hold_nothing_configured_they_hold_the_device_and_activated_they_run(ear):
    assert [ear.state(name) for name in NODES] == [UNCONFIGURED] * len(NODES)
    assert not page_path().exists()
    for name in NODES:
        ear.change(name, Transition.TRANSITION_CONFIGURE, INACTIVE)
    assert page_path().exists() and not ear.truths
    for name in NODES:
        ear.change(name, Transition.TRANSITION_ACTIVATE, ACTIVE)
    ear.cleared()
    ear.engaged()


def test_deactivated_cleaned_up_and_shut_down_in_any_order_they_let_everything_go(ear):
    for name in NODES:
        ear.change(name, Transition.TRANSITION_DEACTIVATE, INACTIVE)
        ear.change(name, Transition.TRANSITION_CLEANUP, UNCONFIGURED)
    assert not page_path().exists()
    for name in NODES:
        ear.change(name, Transition.TRANSITION_UNCONFIGURED_SHUTDOWN, State.PRIMARY_STATE_FINALIZED)


@pytest.mark.parametrize("thread", ["exchange", "servo"])
def test_a_thread_that_fails_ends_the_node_with_a_sentence_and_code_1(ros_domain, thread):
    ends_with_its_sentence("haptic_driver", thread)
