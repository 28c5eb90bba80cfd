# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation alone: it answers handle samples, reports, and refuses what it cannot begin with."""

import contextlib
import subprocess

from ear import SIMULATION, Peer
from handle_samples import MS
from live_nodes import DISPLAY, command, refusal_of

from haptic_device.control import exchange_samples

NODES = {SIMULATION: DISPLAY[SIMULATION] | {"scene": "wall"}}
START = (0.03, 0.0, 0.0)  # of the tool in the scene `wall`


def test_the_node_answers_reports_and_puts_the_tool_back_to_its_start(nodes, ros_domain):
    with contextlib.closing(Peer(ros_domain)) as peer:
        last = peer.lead((0.0, 0.0, 0.0), times=20)
        assert last.position[0] < START[0]
        assert last.stamp_ns == MS * last.position[3 + exchange_samples.ANSWERED]
        peer.news("20 answers", lambda message, values: int(values["answered"]) >= 20)
        peer.news("energy at the tool port", lambda message, values: float(values["tool_port_energy"]) > 0.0)
        assert peer.call("reset_scene")[0]
        assert peer.lead(START).position[:3].tolist() == list(START)


def test_a_bad_parameter_ends_the_node_with_one_sentence(start):
    said = refusal_of(start(command(SIMULATION, scene="nowhere"), stderr=subprocess.PIPE))
    assert said.startswith("haptic_simulation: ") and "nowhere is neither a file nor a name in config/scenes" in said
