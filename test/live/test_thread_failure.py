# SPDX-License-Identifier: Apache-2.0
"""An exception that ends a thread of a node is the node's failure: said in words, the motor at zero, and its end."""

import contextlib
import subprocess
import sys

import pytest
from ear import Ear
from failing import SPACE, THREADS, ends_with_its_sentence, failing, sentence
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from live_nodes import Nodes, command, last_write, page_path, refusal_of

OTHERS = [each for each in THREADS if each[1] not in ("exchange", "servo")]  # these two: smoke/test_life_of_nodes.py


@pytest.mark.parametrize(("name", "thread"), OTHERS)
def test_a_thread_that_fails_ends_the_node_with_a_sentence_and_code_1(ros_domain, name, thread):
    ends_with_its_sentence(name, thread)


def test_without_autostart_the_node_says_error_and_is_inactive_with_the_motor_at_zero(ros_domain, start, tmp_path):
    with contextlib.closing(Ear(ros_domain, SPACE)) as ear, Nodes(tmp_path) as nodes:
        nodes.start("haptic_loopback", namespace=SPACE)
        driver = start(failing("haptic_driver", "exchange", autostart=False, auto_enable=True))
        ear.change("haptic_driver", Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE)
        activate = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_ACTIVATE))
        ear.send("haptic_driver/change_state", activate)
        said = ear.said.setdefault("haptic_driver", [])
        ear.until(
            lambda: any((level, message) == (2, sentence("exchange")) for level, message, _ in said),
            "diagnostics that are ERROR with the sentence",
        )
        ear.until(lambda: ear.state("haptic_driver") == State.PRIMARY_STATE_INACTIVE, "the driver is inactive")
        assert last_write(SPACE).engaged == 0 and last_write(SPACE).motor == [0.0, 0.0, 0.0]
        assert driver.poll() is None


NO_ROOM = """
import sys
from haptic_device.realtime import exchange_loop

def none():
    raise MemoryError("no room for incoming messages")

exchange_loop.incoming_buffer = none
from haptic_device.nodes.driver import main
sys.exit(main())
"""


def test_an_exchange_that_cannot_begin_is_a_refused_activation_is_not_waited_for_and_leaves_no_page(start):
    words = [sys.executable, "-c", NO_ROOM, *command("haptic_driver", "/wrong")[3:]]
    said = refusal_of(start(words, stderr=subprocess.PIPE))
    assert said == "haptic_driver: the exchange cannot begin: MemoryError: no room for incoming messages"
    assert not page_path("/wrong").exists()
