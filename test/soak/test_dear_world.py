# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation alive with a world that takes longer than it has: it answers in order, leaves time out, says so."""

import contextlib
import sys
import time
from pathlib import Path

import pytest
from ear import Peer
from handle_samples import HOME, handle
from waiting import exit_code

from haptic_device.control import exchange_samples
from haptic_sim.exchange.left_out_time import CHEAPER

pytestmark = pytest.mark.timeout(600)

PERIOD, SUB_STEP, LOAD = 0.05, 0.002, 1.5  # [s], [s]; a period long enough for what else a machine does
SAMPLES, LEARNED = 100, 20
SCENE = (
    "{name: slow, method: slow, tool: {mass: 0.1, material: m, shapes: [{circle: {radius: 0.01}}]}, materials: {m: {}}}"
)
SLOW = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from haptic_sim.method_registry import METHODS, Entry
METHODS["slow"] = Entry("slow_method:Slow")
from haptic_sim.node import simulation
from slow_method import Slow
Slow.each = {LOAD * SUB_STEP}
sys.exit(simulation.main())
"""


@pytest.fixture
def node(start, tmp_path):
    """A node whose world takes LOAD times as long as it has."""
    scene, log = tmp_path / "slow.yaml", tmp_path / "log"
    scene.write_text(SCENE)
    given = {"scene": scene, "sub_step": SUB_STEP, "max_catch_up": 1.0}
    words = [part for name, value in given.items() for part in ("-p", f"{name}:={value}")]
    with open(log, "w") as said:
        command = [sys.executable, "-c", SLOW, "--ros-args", "-r", "__ns:=/haptic", *words]
        process = start(command, stdout=said, stderr=said)
    process.log = log
    return process


def send_evenly(peer):
    """Sends samples at least a period apart, whoever is answered: stamps of the samples sent when each answer came."""
    numbers = []

    def come():
        numbers.extend([peer.sequence] * (len(peer.tools) - len(numbers)))
        return time.monotonic() >= due

    for _ in range(SAMPLES):
        due = time.monotonic() + PERIOD
        peer.sequence += 1
        stamp_ns = round(peer.sequence * PERIOD * 1e9)
        peer.handle.publish(handle(float(peer.sequence), position=HOME, stamp_ns=stamp_ns, speed=0.0))
        peer.until(come, "the next sample is due")
    return numbers


def test_a_world_one_and_a_half_times_as_dear_as_its_period_answers_in_order_and_says_what_it_leaves_out(
    node, ros_domain
):
    with contextlib.closing(Peer(ros_domain)) as peer:
        peer.until(lambda: peer.handle.get_subscription_count() and peer._tool.get_publisher_count(), "a simulation")
        sent = send_evenly(peer)
        peer.until(lambda: peer.answered() == SAMPLES, "the answer to the last")
        answered = [tool.position[3 + exchange_samples.ANSWERED] for tool in peer.tools]
        assert answered == sorted(set(answered)) and len(answered) > SAMPLES // 2
        behind = sorted(newest - one for newest, one in zip(sent, answered, strict=False))[LEARNED:]
        assert behind[len(behind) * 3 // 4] <= 1  # it is the newest or the one before, on a busy machine mostly
        said = [one for one in peer.said if one[0].startswith("the world is too dear: it left out")]
        assert said and all(message.endswith(CHEAPER) for message, _ in said)
        values = peer.news("the last sums", lambda message, values: int(values["answered"]) == len(answered))
    passed = (SAMPLES - answered[0]) * PERIOD
    rest = passed - int(values["sub_steps"]) * SUB_STEP - float(values["waited_s"])
    assert float(values["waited_s"]) > 0.2 * passed and -1e-6 <= rest < SUB_STEP
    assert float(values["world_load"]) >= LOAD and values["rejoined"] == "0"
    node.terminate()
    assert exit_code(node) == 0 and "Traceback" not in node.log.read_text()
