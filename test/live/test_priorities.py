# SPDX-License-Identifier: Apache-2.0
"""What the threads of driver and simulation have while these are active: nobody who holds a lock can be put off."""

import os
from pathlib import Path

import pytest
from lifecycle_msgs.msg import State, Transition
from live_nodes import DISPLAY

from haptic_device.nodes import driver
from haptic_device.nodes.exchange_server import PRIORITY as EXCHANGE
from haptic_device.nodes.recorder import PRIORITY as RECORDER
from haptic_device.realtime import scheduling
from haptic_device.realtime.machine import checks

NODES = DISPLAY
LIFTABLE = "haptic_driver", "haptic_simulation"
PERMITTED = next(check.good for check in checks(EXCHANGE) if check.name == "real-time priority")
LIFTED = (os.SCHED_RR, scheduling.INTERPRETER_PRIORITY)
ORDINARY = (os.SCHED_OTHER, 0)


@pytest.fixture(scope="module", params=["prefer", "off"])
def wish(request, nodes, ear):
    """What was wished for, of nodes that exchange samples."""
    for name in LIFTABLE if request.param == "off" else ():
        nodes.have(name, realtime="off", **NODES[name])
    for name in LIFTABLE:
        ear.until(lambda name=name: ear.state(name) == State.PRIMARY_STATE_ACTIVE, f"{name} is active")
    ear.news("haptic_driver", lambda level, message, values: int(values["exchange_answered"]) > 0, "an answer")
    return request.param


def threads(process):
    """[(policy, priority)] of the middleware's threads and of all others of a process, the first of these its main."""
    found = {True: [], False: []}
    for task in sorted(Path(f"/proc/{process.pid}/task").iterdir(), key=lambda task: int(task.name)):
        thread = int(task.name)
        has = os.sched_getscheduler(thread) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(thread).sched_priority
        found[(task / "comm").read_text().startswith("dds.")].append(has)
    return found[True], found[False]


def test_where_it_is_permitted_and_wished_the_executor_that_the_exchange_waits_for_is_lifted_and_else_none(wish, nodes):
    permitted = PERMITTED and wish == "prefer"
    for name in LIFTABLE:
        _, ours = threads(nodes.running[name])
        assert ours[0] == (LIFTED if permitted and name == "haptic_simulation" else ORDINARY), name
        assert (EXCHANGE in [priority for _, priority in ours]) == permitted, name


def test_middleware_is_above_the_exchange_and_who_holds_the_interpreter_below_the_recorder(wish, nodes):
    for name in LIFTABLE:
        of_middleware, _ = threads(nodes.running[name])
        expected = driver.MIDDLEWARE_PRIORITY if PERMITTED and wish == "prefer" else 0
        assert of_middleware and max(priority for _, priority in of_middleware) == expected
    assert driver.MIDDLEWARE_PRIORITY > EXCHANGE > RECORDER > scheduling.INTERPRETER_PRIORITY


def test_of_nodes_that_are_not_active_any_more_python_is_ordinary(wish, nodes, ear):
    for name in LIFTABLE:
        ear.change(name, Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
        _, ours = threads(nodes.running[name])
        assert ours[0] == ORDINARY, name
        ear.change(name, Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
