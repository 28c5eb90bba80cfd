# SPDX-License-Identifier: Apache-2.0
"""What the simulation shows of its world is where its bodies are; the viewer reads the same numbers from it."""

import json
import types

import numpy as np
import pytest
from bag_of_a_run import diagnostics
from fake_node import Node
from live_nodes import STRANGE

from haptic_device.control.withheld import NAMES
from haptic_device.nodes.polled_subscription import Sample
from haptic_device.recording.layouts import CLOUD, JointLayout, layout_of
from haptic_device.status import Status
from haptic_sim.client import Client
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.node.scene_publisher import CONTACT, PERIOD_NS, ScenePublisher, state_names
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import Scene, load, parse
from haptic_sim.viewer.state import NOT_HELD, State

pytestmark = pytest.mark.timeout(600)  # kernels that nobody has used yet are compiled

GAINS = (2000.0, 2.0, 2.0, 0.002)
GUIDED = {
    "name": "guided",
    "joints": [{"type": "slider", "bodies": ["world", "tool"], "at": [0.0, 0.0], "axis": [1.0, 0.0]}],
    "tool": {"mass": 0.1, "shapes": [{"box": {"size": [0.02, 0.02]}}]},
}


class FakeTap:
    """In place of a subscription: hands over what the test puts in."""

    waiting = {}

    def __init__(self, node, topic, type_name, qos, raw=False):
        self.topic = topic

    def take(self):
        return [Sample(message, 0, 0, 0) for message in self.waiting.pop(self.topic, [])]

    def latest(self):
        return next(reversed(self.take()), None)


@pytest.fixture(autouse=True)
def tapped(monkeypatch):
    monkeypatch.setattr("haptic_sim.client.PolledSubscription", FakeTap)


def shown(node):
    """What a viewer knows that has heard what this node said."""
    state = State(Client(Node()))
    FakeTap.waiting = {topic: node.said[topic] for topic in ("scene", "scene/state")}
    state.look()
    return state


@pytest.fixture
def pressed():
    """A peg that has been pressed upon the mouth of the hole, and its scene."""
    simulation, start = Simulation(reduce_scene(load("peg_in_hole"))), (0.03, 0.11, 0.0)
    for k in range(400):
        place = (start[0], start[1] - 0.0002 * min(k, 150), 0.0)
        simulation.exchange(HandleSample(1_000_000 * k, place, (0.0, 0.0, 0.0), *GAINS))
    return simulation, place


def test_the_state_names_each_coordinate_and_carries_the_poses(pressed):
    simulation, handle = pressed
    node = Node()
    ScenePublisher(node).show(simulation, handle, 0)
    layout = JointLayout(state_names(simulation.scene), "haptic_map")
    [data] = node.said["scene/state"]
    assert layout.matches(data)
    sample = layout.unpack(data)
    found = dict(zip(layout.names, sample.position, strict=True))
    assert [found[f"handle.{axis}"] for axis in ("x", "y", "theta")] == list(handle)
    assert [found[f"tool.{axis}"] for axis in ("x", "y", "theta")] == list(simulation.method.position)
    assert found["result.insertion_fraction"] == simulation.measure()["insertion_fraction"]
    assert found["energy"] == simulation.ledger.supplied
    assert sample.effort[3:6] == pytest.approx(simulation.method.force_on_tool)


def test_contacts_carry_the_force_that_holds_the_tool_up(pressed):
    simulation, handle = pressed
    node = Node()
    ScenePublisher(node).show(simulation, handle, 0)
    message = bytes(node.said["scene/contacts"][0])
    rows = np.frombuffer(layout_of(CLOUD, message).records(message), CONTACT)
    [contact] = simulation.method.contacts()[-1:]
    assert (rows["body_a"][-1], rows["body_b"][-1]) == (0.0, 1.0)
    assert (rows["force_x"][-1], rows["force_y"][-1]) == contact.force_on_a and rows["force_y"][-1] > 0.0


def test_the_scene_is_said_once_and_anew_when_it_is_another():
    node = Node()
    showing = ScenePublisher(node)
    first, other = Simulation(reduce_scene(load("peg_in_hole"))), Simulation(reduce_scene(load("free_space")))
    for number, simulation in enumerate((first, first, other)):
        showing.show(simulation, None, number * PERIOD_NS)
    scenes = [Scene.model_validate(json.loads(message.data)) for message in node.said["scene"]]
    assert scenes == [first.scene, other.scene]


def test_the_world_is_shown_no_faster_than_it_is_looked_at():
    node, simulation = Node(), Simulation(reduce_scene(load("free_space")))
    showing = ScenePublisher(node)
    for millisecond in range(1000):
        showing.show(simulation, None, 1_000_000 * millisecond)
    assert 55 <= len(node.said["scene/state"]) <= 61


def test_the_viewer_reads_what_the_simulation_shows(pressed):
    simulation, handle = pressed
    node = Node()
    ScenePublisher(node).show(simulation, handle, 0)
    state = shown(node)
    frame = state.frame()
    assert frame["tool"] == simulation.method.position and state.scene == drawing_of(simulation.scene)
    assert frame["results"] == tuple(simulation.measure().values())
    assert frame["handle"] is None, "without a driver the handle it told last is old"
    FakeTap.waiting = {"scene": [types.SimpleNamespace(data="{no scene")]}
    state.look()
    assert state.scene is None and "cannot be read" in state.problem and state.frame()["tool"] is None


def test_a_tool_that_cannot_turn_is_shown_as_it_stands_under_a_hand_that_turns():
    simulation, handle = Simulation(reduce_scene(parse(GUIDED, "guided"))), (0.01, 0.0, 0.3)
    for k in range(1000):
        simulation.exchange(HandleSample(1_000_000 * k, handle, (0.0, 0.0, 0.0), *GAINS))
    node = Node()
    ScenePublisher(node).show(simulation, handle, 0)
    state = shown(node)
    state.statuses = {"haptic_driver": Status(0, 0, "engaged", {})}
    frame = state.frame()
    assert frame["tool"] == pytest.approx((0.01, 0.0, 0.0), abs=1e-3)
    assert frame["handle"] == handle and state.scene.joints


def test_what_is_no_number_is_not_known(pressed):
    simulation, _ = pressed
    node = Node()
    simulation.measure = lambda: {"insertion_fraction": float("nan")}
    ScenePublisher(node).show(simulation, (float("inf"), 0.0, 0.0), 0)
    state = shown(node)
    state.statuses = {"haptic_driver": Status(0, 0, "engaged", {})}
    frame = state.frame()
    assert frame["handle"] is None and frame["tool"] == simulation.method.position
    assert np.isnan(frame["results"]).all()


@pytest.mark.parametrize(("withheld", "coupled"), [("", True), ("limit", True), ("tank, limit", False)])
def test_a_coupling_that_the_driver_says_does_not_hold_is_shown_as_one(withheld, coupled):
    state = State(Client(Node()))
    FakeTap.waiting = {"/diagnostics": [diagnostics("haptic_driver", {"namespace": "/haptic", "withheld": withheld})]}
    state.look()
    assert state.frame()["coupled"] == coupled and {*NAMES} > NOT_HELD


@pytest.mark.parametrize(("said", "heard"), [("/haptic", 1), ("/left", 0), (None, 1)])
def test_what_the_nodes_of_another_display_say_is_not_taken_for_the_own_ones(said, heard):
    client, values = Client(Node()), {"namespace": said} if said else {}
    FakeTap.waiting = {"/diagnostics": [diagnostics("haptic_driver", values)]}
    client.look()
    assert len(client.statuses) == len(client.heard) == heard


def test_rubbish_on_the_topics_of_the_page_is_not_shown_and_harms_nothing(pressed):
    node = Node()
    ScenePublisher(node).show(*pressed, 0)
    state = State(Client(Node()))
    cut = types.SimpleNamespace(point_step=CONTACT.itemsize, data=bytes(CONTACT.itemsize + 1))
    FakeTap.waiting = {"scene": node.said["scene"], "scene/state": [b"", b"\0" * 500], "scene/contacts": [cut]}
    FakeTap.waiting |= {"operator/state": [b""], "/diagnostics": STRANGE}
    state.look()
    frame = state.frame()
    assert state.scene and frame["contacts"] == [] and frame["tool"] is None and frame["handle"] is None
    assert {name: said.level for name, said in state.statuses.items() if said.level} == {"seven": 3, "all bits": 3}
    FakeTap.waiting = {"scene": [types.SimpleNamespace(data="[" * 100_000)]}
    state.look()
    assert state.scene is None and "cannot be read" in state.problem
