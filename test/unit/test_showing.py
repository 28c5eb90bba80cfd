# SPDX-License-Identifier: Apache-2.0
"""What the simulation shows of its world is where its bodies are; the viewer reads the same numbers from it."""

import copy
import json
import types
from dataclasses import asdict

import numpy as np
import pytest
from bag_of_a_run import diagnostics
from fake_node import Node
from live_nodes import STRANGE

from haptic_device.nodes.polled_subscription import Sample
from haptic_device.recording.layouts import CLOUD, JointLayout, layout_of
from haptic_device.recording.status import Status
from haptic_display.client import Client
from haptic_display.page.state import State
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.node.scene_publisher import CONTACT, PERIOD_NS, ScenePublisher, state_names
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import Scene, load, parse

pytestmark = pytest.mark.timeout(600)  # kernels that nobody has used yet are compiled

GAINS = (2000.0, 2.0, 2.0, 0.002)
DRIVEN = {"haptic_driver": Status(0, 0, "engaged", {})}
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
    monkeypatch.setattr("haptic_display.client.PolledSubscription", FakeTap)


def shown(node):
    """What a viewer knows that has heard what this node said."""
    state = State(Client(Node()))
    FakeTap.waiting = {topic: node.said[topic] for topic in ("scene", "scene/state")}
    state.look()
    return state


@pytest.fixture(scope="module")
def pressed_once():
    """A peg that has been pressed upon the mouth of the hole, and its scene."""
    simulation, start = Simulation(reduce_scene(load("peg_in_hole"))), (0.03, 0.11, 0.0)
    for k in range(400):
        place = (start[0], start[1] - 0.0002 * min(k, 150), 0.0)
        simulation.exchange(HandleSample(1_000_000 * k, place, (0.0, 0.0, 0.0), *GAINS))
    return simulation, place


@pytest.fixture
def pressed(pressed_once):
    """The same for each test, which may measure something else."""
    simulation, place = pressed_once
    return copy.copy(simulation), place


def published(simulation, handle):
    node = Node()
    ScenePublisher(node).show(simulation, handle, 0)
    return node


def test_the_state_names_each_coordinate_and_contacts_carry_the_force_that_holds_the_tool_up(pressed):
    simulation, handle = pressed
    node = published(simulation, handle)
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
    message = bytes(node.said["scene/contacts"][0])
    last = np.frombuffer(layout_of(CLOUD, message).records(message), CONTACT)[-1]
    [contact] = simulation.method.contacts()[-1:]
    assert (last["body_a"], last["body_b"]) == (0.0, 1.0)
    assert (last["force_x"], last["force_y"]) == contact.force_on_a and last["force_y"] > 0.0


def test_the_scene_is_said_once_and_anew_when_it_is_another_and_shown_no_faster_than_it_is_looked_at():
    node = Node()
    showing = ScenePublisher(node)
    first, other = Simulation(reduce_scene(load("peg_in_hole"))), Simulation(reduce_scene(load("free_space")))
    for number, simulation in enumerate((first, first, other)):
        showing.show(simulation, None, number * PERIOD_NS)
    scenes = [Scene.model_validate(json.loads(message.data)) for message in node.said["scene"]]
    assert scenes == [first.scene, other.scene]
    node.said["scene/state"].clear()
    for millisecond in range(1000):
        showing.show(other, None, 10**9 + 1_000_000 * millisecond)
    assert 55 <= len(node.said["scene/state"]) <= 61


@pytest.mark.parametrize("name", ("peg_in_hole", "four_bar", "slider", "stack_20"))
def test_a_scene_survives_its_way_over_the_topic_and_can_be_drawn(name):
    scene = load(name)
    again = Scene.model_validate_json(scene.model_dump_json(by_alias=True, exclude_unset=True))
    assert again == scene
    drawn = json.loads(json.dumps(asdict(drawing_of(again)), allow_nan=False))
    assert len(drawn["solids"]) == 1 + len(scene.bodies)
    left, bottom, right, top = drawn["room"]
    assert left < scene.tool.pose[0] < right and bottom < scene.tool.pose[1] < top


def test_the_viewer_reads_what_the_simulation_shows_and_what_is_no_number_is_not_known(pressed):
    simulation, handle = pressed
    state = shown(published(simulation, handle))
    frame = state.frame()
    assert frame["tool"] == simulation.method.position and state.scene == drawing_of(simulation.scene)
    assert frame["results"] == tuple(simulation.measure().values())
    assert frame["handle"] is None, "without a driver the handle it told last is old"
    state.statuses = DRIVEN
    assert state.frame()["handle"] == handle
    simulation.measure = lambda: {"insertion_fraction": float("nan")}
    state = shown(published(simulation, (float("inf"), 0.0, 0.0)))
    state.statuses = DRIVEN
    frame = state.frame()
    assert frame["handle"] is None and frame["tool"] == simulation.method.position
    assert np.isnan(frame["results"]).all()


def test_a_tool_that_cannot_turn_is_shown_as_it_stands_under_a_hand_that_turns():
    simulation, handle = Simulation(reduce_scene(parse(GUIDED, "guided"))), (0.01, 0.0, 0.3)
    for k in range(1000):
        simulation.exchange(HandleSample(1_000_000 * k, handle, (0.0, 0.0, 0.0), *GAINS))
    state = shown(published(simulation, handle))
    assert state.frame()["tool"] == pytest.approx((0.01, 0.0, 0.0), abs=1e-3) and state.scene.joints


@pytest.mark.parametrize(("withheld", "coupled"), [("", True), ("limit", True), ("tank, limit", False)])
def test_a_coupling_that_the_driver_says_does_not_hold_is_shown_as_one(withheld, coupled):
    state = State(Client(Node()))
    FakeTap.waiting = {"/diagnostics": [diagnostics("haptic_driver", {"namespace": "/haptic", "withheld": withheld})]}
    state.look()
    assert state.frame()["coupled"] == coupled


@pytest.mark.parametrize(("said", "heard"), [("/haptic", 1), ("/left", 0), (None, 1)])
def test_what_the_nodes_of_another_display_say_is_not_taken_for_the_own_ones(said, heard):
    client, values = Client(Node()), {"namespace": said} if said else {}
    FakeTap.waiting = {"/diagnostics": [diagnostics("haptic_driver", values)]}
    client.look()
    assert len(client.statuses) == len(client.heard) == heard


def test_rubbish_on_the_topics_of_the_page_is_not_shown_and_harms_nothing(pressed):
    node, state = published(*pressed), State(Client(Node()))
    cut = types.SimpleNamespace(point_step=CONTACT.itemsize, data=bytes(CONTACT.itemsize + 1))
    FakeTap.waiting = {"scene": node.said["scene"], "scene/state": [b"", b"\0" * 500], "scene/contacts": [cut]}
    FakeTap.waiting |= {"operator/state": [b""], "/diagnostics": STRANGE}
    state.look()
    frame = state.frame()
    assert state.scene and frame["contacts"] == [] and frame["tool"] is None and frame["handle"] is None
    assert {name: said.level for name, said in state.statuses.items() if said.level} == {"seven": 3, "all bits": 3}
    for rubbish in ("[" * 100_000, "{no scene"):
        FakeTap.waiting = {"scene": [types.SimpleNamespace(data=rubbish)]}
        state.look()
        assert state.scene is None and "cannot be read" in state.problem and state.frame()["tool"] is None
