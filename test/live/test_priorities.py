# SPDX-License-Identifier: Apache-2.0
"""What the threads of nodes have while these are active: nobody who holds a lock can be put off."""

import os
from pathlib import Path

import pytest
from lifecycle_msgs.msg import State, Transition
from live_nodes import DISPLAY
from waiting import until

from haptic_device.nodes import driver
from haptic_device.nodes.exchange_server import PRIORITY as EXCHANGE
from haptic_device.nodes.recorder import PRIORITY as RECORDER
from haptic_device.realtime import scheduling

pytestmark = pytest.mark.realtime("real-time priority")
NODES = DISPLAY
LIFTABLE = "haptic_driver", "haptic_simulation"
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


def test_where_it_is_wished_the_executor_that_the_exchange_waits_for_is_lifted_and_else_none(wish, nodes):
    """Middleware stands above the exchange, and who holds the interpreter below the recorder."""
    for name in LIFTABLE:
        of_middleware, ours = threads(nodes.running[name])
        lifted = wish == "prefer" and name == "haptic_simulation"
        assert ours[0] == (LIFTED if lifted else ORDINARY), name
        assert (EXCHANGE in [priority for _, priority in ours]) == (wish == "prefer"), name
        expected = driver.MIDDLEWARE_PRIORITY if wish == "prefer" else 0
        assert of_middleware and max(priority for _, priority in of_middleware) == expected
    assert driver.MIDDLEWARE_PRIORITY > EXCHANGE > RECORDER > scheduling.INTERPRETER_PRIORITY


def test_a_recorder_keeps_to_its_first_core_where_that_is_wished_and_may_else_run_on_all(wish, nodes, tmp_path):
    every = os.sched_getaffinity(0)
    process = nodes.start("haptic_recorder", bag=str(tmp_path / "bag"), realtime=wish)
    until(lambda: list(tmp_path.glob("bag/*.mcap")), "the bag")
    policy = os.sched_getscheduler(process.pid) & ~os.SCHED_RESET_ON_FORK
    cores = [os.sched_getaffinity(int(thread)) for thread in os.listdir(f"/proc/{process.pid}/task")]
    nodes.lack("haptic_recorder")
    assert policy == (os.SCHED_RR if wish == "prefer" else os.SCHED_OTHER)
    assert len(cores) > 1 and all(allowed == ({min(every)} if wish == "prefer" else every) for allowed in cores)


def test_of_nodes_that_are_not_active_any_more_python_is_ordinary(wish, nodes, ear):
    for name in LIFTABLE:
        ear.change(name, Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
        _, ours = threads(nodes.running[name])
        assert ours[0] == ORDINARY, name
        ear.change(name, Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
