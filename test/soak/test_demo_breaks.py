# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` with a node that dies, and with a fault."""

import contextlib
import json

import psutil
import pytest
from live_demo import BUSY, children, demos, pages, running
from live_nodes import MODULES
from waiting import LIMIT, until

from haptic_display.client import Client
from haptic_display.run.processes import NAMESPACE
from haptic_display.service_requests import trigger

pytestmark = pytest.mark.timeout(900)


@pytest.fixture
def demo(tmp_path):
    """demo(*options) starts it; whatever the test came to, it and its nodes have ended afterwards."""
    with demos(tmp_path) as start:
        yield start


def test_a_dead_node_ends_the_demo_and_is_named(demo):
    run = demo("--json", *BUSY)
    until(run.bag.exists, "the bag", said=lambda: run.progress)
    until(lambda: len(children(run.process)) == len(MODULES) + 1, "the last of the nodes", said=lambda: run.progress)
    nodes = children(run.process)
    node_of(run, "haptic_simulation").kill()
    assert run.ended() == 1 and "haptic_simulation was ended by SIGKILL (signal 9)" in run.progress
    assert "had to be killed" not in run.progress
    assert not json.loads(run.said)["done"] and (run.bag / "metadata.yaml").exists()
    assert not running(nodes) and not pages()


def node_of(run, name):
    """Its process, once it is there."""
    for node in children(run.process):
        with contextlib.suppress(psutil.NoSuchProcess):  # one that has just ended has no words
            if MODULES[name] in node.cmdline():
                return node
    return None


def test_a_fault_ends_a_demo_that_was_to_last_an_hour_and_its_cause_is_said(demo, ros_domain):
    run = demo("--json", "--seconds", "3600", *BUSY, scene="free_space")
    with contextlib.closing(Client.join("stops", ros_domain, NAMESPACE)) as client:

        def moves():
            client.look()
            return client.said("haptic_driver", "state") == "engaged" and client.motor_commanded

        until(moves, "the motor moves the handle", said=lambda: run.progress)
        client.call(trigger("haptic_driver/estop"), patience=LIMIT)
    assert run.ended() == 1
    found, fell = json.loads(run.said), "Emergency stop (fault estop): a person or a program pressed stop"
    # whether the demo saw the motor between two looks, before it was stopped, is not said here
    assert found["why"].endswith(f": {fell}. Start again.")
    assert found["faults"] == ["estop"] and not found["done"] and found["seconds"] > 0.0
