# SPDX-License-Identifier: Apache-2.0
"""The example's node with a body of one's own: the tool meets it, also after a reset and in the next world."""

import contextlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from ear import SIMULATION, Peer
from waiting import exit_code

from haptic_device.control import exchange_samples

EXAMPLE = Path(__file__).parents[2] / "examples/own_bodies.py"
COMMAND = [sys.executable, str(EXAMPLE), "--ros-args", "-r", "__ns:=/haptic", "-p", "scene:=free_space"]
START, BEHIND_THE_FLAP = (0.0, 0.0, 0.0), (-0.05, 0.02, 0.0)
REFUSAL = (
    "scene 'free_space' gets the method closed_form, which takes no bodies of your own: write method: impulse in the "
    "scene, or start the node with method:=impulse"
)


@pytest.fixture
def peer(ros_domain):
    with contextlib.closing(Peer(ros_domain)) as peer:
        yield peer


def touches(sample):
    return sample.position[3 + exchange_samples.CONTACT] == 1.0


def meets_the_flap(peer):
    """From its start the tool, alone in its scene, goes free and then does not."""
    first = peer.lead(START)
    assert not touches(first) and first.position[:3].tolist() == list(START)
    peer.until(lambda: touches(peer.lead(BEHIND_THE_FLAP)), "a contact with the flap")
    assert peer.tools[-1].position[0] < -0.01


def test_the_tool_meets_the_flap_of_the_example_again_after_a_reset_and_after_the_scene_was_loaded(
    start, peer, tmp_path
):
    log = tmp_path / "log"
    with log.open("w") as stream:
        node = start([*COMMAND, "-p", "method:=impulse"], stdout=stream, stderr=subprocess.STDOUT)
        meets_the_flap(peer)
        assert peer.call("reset_scene") == (True, "scene is at its start")
        meets_the_flap(peer)
        assert peer.load_scene("free_space") == (True, "scene is free_space")
        meets_the_flap(peer)
        assert peer.set("method", "auto", SIMULATION) == (True, "")
        assert peer.load_scene("free_space") == (False, REFUSAL)
        assert touches(peer.lead(BEHIND_THE_FLAP))
        node.send_signal(signal.SIGINT)
        assert exit_code(node) == 0
    assert "Traceback" not in log.read_text()
