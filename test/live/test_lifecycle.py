# SPDX-License-Identifier: Apache-2.0
"""Managed nodes driven from outside, as `ros2 lifecycle` and a launch file do: each state is what it says."""

import os
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from ear import Ear
from lifecycle_msgs.msg import State, Transition
from live_nodes import MODULES, SLOW, Nodes, page_path
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions
from waiting import output, run, until

from haptic_device.process import ending_with_us
from haptic_sim.node.network_emulator import NetworkEmulator

pytestmark = pytest.mark.timeout(600)

SPACE = "/managed"
NODES = tuple(MODULES)
OF_ITS_OWN = {
    "haptic_simulation": {"scene": "free_space"},  # its tool is where the handle is
    "haptic_driver": {"auto_enable": True, **SLOW},
}
UNCONFIGURED, INACTIVE, ACTIVE = (
    State.PRIMARY_STATE_UNCONFIGURED,
    State.PRIMARY_STATE_INACTIVE,
    State.PRIMARY_STATE_ACTIVE,
)


@pytest.fixture(scope="module")
def nodes(ros_domain, tmp_path_factory):
    with Nodes(tmp_path_factory.mktemp("nodes")) as nodes:
        for name in NODES:
            nodes.start(name, namespace=SPACE, autostart=False, **OF_ITS_OWN.get(name, {}))
        yield nodes


@pytest.fixture(scope="module")
def ear(ros_domain, nodes):
    ear = Ear(ros_domain, SPACE)
    yield ear
    ear.close()


def test_without_autostart_the_nodes_wait_and_hold_nothing(ear):
    assert [ear.state(name) for name in NODES] == [UNCONFIGURED] * len(NODES)
    assert not page_path(SPACE).exists()


def test_configured_they_hold_the_device_and_activated_they_run(ear):
    for name in NODES:
        ear.change(name, Transition.TRANSITION_CONFIGURE, INACTIVE)
    assert page_path(SPACE).exists() and not ear.truths
    for name in NODES:
        ear.change(name, Transition.TRANSITION_ACTIVATE, ACTIVE)
    ear.cleared()
    ear.engaged()


def test_an_estop_outlives_a_deactivation_also_with_auto_enable(ear):
    def again():
        ear.change("haptic_driver", Transition.TRANSITION_ACTIVATE, ACTIVE)
        ear.news("haptic_driver", lambda level, message, values: values["fault"] == "estop", what="the e-stop")
        assert ear.trigger("enable") == (False, "fault estop is latched; call ~/reset first")

    assert ear.trigger("estop")[0]
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    again()
    ear.cleared()
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    assert ear.trigger("estop") == (True, "e-stop latched for when the node is active again")
    again()


def test_who_disables_an_inactive_driver_finds_it_idle_when_it_is_active_and_the_next_time_it_enables_by_itself(ear):
    heard = ear.said["haptic_driver"]

    def states(after):
        """Those that were told since the last activation, once it has gone on for so many ticks."""
        ear.change("haptic_driver", Transition.TRANSITION_ACTIVATE, ACTIVE)
        begin = len(heard)
        ear.until(lambda: len(heard) > begin and int(heard[-1][2]["ticks"]) > after, f"{after} ticks")
        return [values["state"] for _, _, values in heard[begin:]]

    ear.cleared()
    # of what was said before, nothing is heard later
    ear.news("haptic_driver", lambda level, message, values: values["state"] == "idle", what="it is idle")
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    assert ear.trigger("disable") == (True, "motor zero: the servo does not run")
    assert set(states(after=2 * SLOW["servo__rate"])) == {"idle"}
    ear.change("haptic_driver", Transition.TRANSITION_DEACTIVATE, INACTIVE)
    states(after=1)
    ear.news("haptic_driver", lambda level, message, values: values["state"] != "idle", what="enabled by itself")


def test_deactivated_cleaned_up_and_shut_down_in_any_order_they_let_everything_go(ear):
    for name in NODES:
        ear.change(name, Transition.TRANSITION_DEACTIVATE, INACTIVE)
        ear.change(name, Transition.TRANSITION_CLEANUP, UNCONFIGURED)
    assert not page_path(SPACE).exists()
    for name in NODES:
        ear.change(name, Transition.TRANSITION_UNCONFIGURED_SHUTDOWN, State.PRIMARY_STATE_FINALIZED)


TOLD = """
import gc, importlib, os, signal, sys, threading
from haptic_device.nodes import lifecycle, participant_id
participant_id.KINDS = ()  # a process can give a port of its own to one participant only
module = importlib.import_module(sys.argv[1])
[kind] = [one for one in vars(module).values() if isinstance(one, type) and lifecycle.ManagedNode in one.__bases__]
MOMENTS = ((lifecycle, "begin_ros"), (kind, "__init__"), (lifecycle, "SingleThreadedExecutor"), (kind, "configure"),
           (kind, "activate"), (threading.Thread, "start"), (threading.Event, "wait"), (kind, "finish"))

def tell():
    os.kill(os.getpid(), signal.SIGTERM)

def telling(owner, name, before):
    plain = getattr(owner, name)
    def told(*given, **named):
        if before:
            tell()
        try:
            return plain(*given, **named)
        finally:
            tell()
    setattr(owner, name, told)
    return plain

for owner, name in MOMENTS:
    plain = telling(owner, name, sys.argv[2] == "before")
    if name == "finish":
        active = telling(kind, "activate", False)
    print(name, sys.argv[2], flush=True)
    print(module.main(["--ros-args", "-r", "__ns:=/told"]), flush=True)
    setattr(owner, name, plain)
    if name == "finish":
        kind.activate = active
    gc.collect()  # one participant at a time
"""


@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("name", NODES)
def test_a_node_told_to_end_at_any_moment_of_its_start_ends_as_it_always_does(name, when):
    command = ending_with_us([sys.executable, "-c", TOLD, MODULES[name], when])
    told = run(command)
    assert told.returncode == 0, (told.stdout, told.stderr)
    assert {*told.stdout.split("\n")[1::2]} == {"0"}, told.stdout
    assert "Traceback" not in told.stderr and "Exception" not in told.stderr, told.stderr


@pytest.mark.parametrize("module", [*MODULES.values(), "haptic_device.nodes.recorder"])
def test_signals_that_come_while_a_node_ends_change_nothing_of_its_end(module, start):
    words = ["--ros-args", "-r", "__ns:=/told", "-p", "autostart:=false"]
    node = start([sys.executable, "-m", module, *words], stderr=subprocess.PIPE)
    until(lambda: len(os.listdir(f"/proc/{node.pid}/task")) > 3, "the threads of its middleware")
    while node.poll() is None:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            node.send_signal(number)
            time.sleep(0.001)
    said = output(node)[1]
    assert (node.returncode, "Traceback" in said) == (0, False), said


def test_a_relay_that_is_configured_and_cleaned_up_again_and_again_keeps_nothing():
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = NetworkEmulator()

        def entities():
            return len(list(node.subscriptions)), len(list(node.publishers))

        before = entities()
        for _ in range(3):
            assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
            assert entities() == (before[0] + 3, before[1] + 3)
            assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
            assert entities() == before
        node.finish()
        node.destroy_node()
    finally:
        rclpy.shutdown()
