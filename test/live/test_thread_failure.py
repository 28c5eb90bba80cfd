# SPDX-License-Identifier: Apache-2.0
"""An exception that ends a thread of a node is the node's failure: said in words, the motor at zero, and its end."""

import sys

import pytest
from ear import Ear
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from live_nodes import MODULES, SLOW, Nodes, command, last_write
from waiting import run

from haptic_device.process import ending_with_us

SPACE = "/failing"
# A function raises from its n-th call on; `compile` is what makes a kernel ready before it is called.
_FAILING = """
import importlib, itertools, sys
node, place, number = sys.argv.pop(1), sys.argv.pop(1), int(sys.argv.pop(1))
module, *kind, name = place.split(":")
owner = importlib.import_module(module)
owner = getattr(owner, kind[0]) if kind else owner
does, calls = getattr(owner, name), itertools.count(1)
def fails(*given):
    if next(calls) >= number:
        raise RuntimeError("nobody foresaw this")
    return does(*given)
fails.compile = getattr(does, "compile", None)
setattr(owner, name, fails)
sys.exit(importlib.import_module(node).main())
"""
THREADS = {
    ("haptic_driver", "exchange"): ("haptic_device.realtime.exchange_loop:run_exchange", 2),
    ("haptic_driver", "servo"): ("haptic_device.realtime.hardware_interface:SharedMemoryInterface:present", 2),
    ("haptic_driver", "services"): ("haptic_device.nodes.service_thread:ServiceThread:_run", 1),
    ("haptic_driver", "telemetry"): ("haptic_device.nodes.telemetry:Telemetry:_publish_trace", 3),
    ("haptic_loopback", "plant"): ("haptic_device.device.simulated_device:serve", 1),
    ("haptic_loopback", "telemetry"): ("haptic_device.nodes.truth_publisher:TruthPublisher:_bytes", 3),
}


def failing(name, thread, **given):
    """Command line of a node of which this thread fails."""
    place, number = THREADS[name, thread]
    words = command(name, SPACE, **given)
    return [sys.executable, "-c", _FAILING, MODULES[name], place, str(number), *words[3:]]


def sentence(thread):
    return f"the {thread} thread ended: RuntimeError: nobody foresaw this"


@pytest.mark.parametrize(("name", "thread"), THREADS)
def test_a_thread_that_fails_ends_the_node_with_a_sentence_and_code_1(ros_domain, name, thread):
    words = ending_with_us(failing(name, thread, **(SLOW if name == "haptic_driver" else {})))
    ended = run(words)
    assert ended.returncode == 1 and "Traceback" not in ended.stderr, ended.stderr
    assert f"{name}: {sentence(thread)}" in ended.stderr.splitlines(), ended.stderr
    assert f"[/failing/{name}]" in ended.stderr or f"[failing.{name}]" in ended.stderr  # logged too


def test_without_autostart_the_node_says_error_and_is_inactive_with_the_motor_at_zero(ros_domain, start, tmp_path):
    ear = Ear(ros_domain, SPACE)
    try:
        with Nodes(tmp_path) as nodes:
            nodes.start("haptic_loopback", namespace=SPACE)
            driver = start(failing("haptic_driver", "exchange", autostart=False, auto_enable=True, **SLOW))
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
    finally:
        ear.close()
