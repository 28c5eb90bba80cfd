# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation alive between two topics: it answers, loads, pauses, and says at its end how things stand."""

import contextlib
import signal

import pytest
from ear import SIMULATION, Peer
from live_nodes import DISPLAY
from waiting import exit_code

from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

NODES = {SIMULATION: DISPLAY[SIMULATION]}


@pytest.fixture(scope="module")
def peer(ros_domain):
    with contextlib.closing(Peer(ros_domain)) as peer:
        yield peer


@pytest.fixture
def world(nodes, peer):
    """The node with the scene `wall` at its start."""
    assert peer.load_scene("wall")[0]


START = (0.03, 0.0, 0.0)  # of the tool in the scene `wall`


def test_a_scene_that_cannot_be_read_is_refused_and_another_starts_from_its_own_home(world, peer):
    taken, reason = peer.set("scene", "nowhere", SIMULATION)
    assert not taken and "nowhere is neither a file nor a name" in reason
    assert peer.load_scene("corner") == (True, "scene is corner")
    assert peer.lead((0.03, 0.04, 0.0)).position[:3].tolist() == [0.03, 0.04, 0.0]
    peer.until(lambda: peer.lead((0.02, 0.04, 0.0)).position[0] < 0.03, "the tool leaves its home")
    assert peer.tools[-1].position[0] > 0.02


def test_paused_the_world_says_nothing_and_then_goes_on_from_where_it_was(world, peer):
    there = (0.02, 0.0, 0.0)
    place = peer.lead(there, times=100, step=10).position[0]
    assert place == pytest.approx(there[0], abs=1e-6)
    assert peer.pause(True) == (True, "paused")
    answers, begin = len(peer.tools), len(peer.said)

    def told_twice():
        """Samples that would move the tool, until the node has said twice that it is paused."""
        peer.send_handle((0.0, 0.0, 0.0))
        peer.look(0.02)
        return [message for message, _ in peer.said[begin:]].count("paused") >= 2

    peer.until(told_twice, "two reports of the pause")
    assert len(peer.tools) == answers
    assert peer.pause(False)[0]
    assert peer.lead(there, times=5).position[0] == pytest.approx(place, abs=1e-6)


def test_told_to_end_the_node_says_how_things_then_stand(world, nodes, peer):
    process = nodes.running[SIMULATION]
    assert peer.load_scene("peg_in_hole")[0]
    peer.lead(times=5)
    before = len(peer.said)
    process.send_signal(signal.SIGTERM)
    exit_code(process)
    peer.until(lambda: peer.said[before:] and "result.insertion_fraction" in peer.said[-1][1], "the last word")
    _, values = peer.said[-1]
    assert float(values["result.insertion_fraction"]) == pytest.approx(-0.5, abs=0.01)
    assert {"max_contact_force", "max_penetration", "refused", "rejoined", "sub_steps"} <= values.keys()
    reduced = reduce_scene(load("peg_in_hole"))
    assert (values["method"], values["why"]) == (reduced.method, reduced.reasons[0])
    assert nodes.end(SIMULATION) == 0
