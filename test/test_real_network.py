# SPDX-License-Identifier: Apache-2.0
"""Driver and loopback on one host, the simulation on another, a bad network between: two network namespaces."""

import signal
import time

import bad_link
import numpy as np
import pytest
from live_nodes import command, page_path

from haptic_device.analysis.recording import load
from haptic_device.runtime import page
from haptic_sim.cli.processes import Program

PRESSING = {"motion__name": "hold", "motion__start": [0.007, 0.0, 0.0]}  # 3 mm deep in the wall of the scene
DRIVER = {
    "auto_enable": True, "servo__rate": 2000.0, "coupling__stiffness": 2000.0, "coupling__damping": 2.0,
    "coupling__rotational_stiffness": 1.0, "coupling__rotational_damping": 0.002, "engage__force": 20.0,
}  # fmt: skip
SLEW, BUDGET = 0.5, 0.005  # [N/ms], [J]


def motor_x():
    """Force [N] that the driver last wrote into the device page, which all namespaces share."""
    if not page_path().exists():
        return 0.0
    block = np.zeros(page.SERVO_WORDS, np.int64)
    page.read_servo(np.fromfile(page_path(), np.int64), block)
    return float(block[5:6].view(np.float64)[0])


def wait_for(condition, what, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"{what} did not come within {seconds} s"
        time.sleep(0.02)


@pytest.fixture
def link():
    try:
        with bad_link.Link(delay=4e-3, jitter=2e-3, loss=0.05, duplicates=0.05) as link:
            yield link
    except OSError as refusal:
        pytest.skip(str(refusal))


@pytest.fixture
def across(link, start, monkeypatch, tmp_path):
    """The four nodes, started on their sides of the link; what ends them all, the recorder first, and the bag."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    nodes = {
        "far": [command("haptic_simulation", scene="wall")],
        "near": [
            command("haptic_loopback", **PRESSING),
            Program("haptic_recorder", "haptic_device.node.recorder", {"bag": str(tmp_path / "bag")}).command(),
            command("haptic_driver", **DRIVER),
        ],
    }
    log = open(tmp_path / "log", "w")  # noqa: SIM115
    started = [start(link.inside(where, words), stdout=log, stderr=log) for where in nodes for words in nodes[where]]

    def end():
        for process in (started[2], *started):
            process.send_signal(signal.SIGINT)
        return [process.wait(30.0) for process in started]

    yield end, tmp_path / "bag"
    log.close()


def test_behind_a_bad_network_and_a_cut_of_two_seconds_contact_is_passive_and_comes_back_without_a_kick(link, across):
    end, bag = across
    wait_for(lambda: motor_x() > 0.8, "contact")
    time.sleep(0.5)
    link.set(cut=True)
    time.sleep(2.0)
    assert motor_x() == pytest.approx(0.0, abs=0.05)
    link.set(cut=False)
    wait_for(lambda: motor_x() > 0.8, "contact after the cut")
    time.sleep(0.5)
    assert end() == [0] * 4
    recording = load(bag)
    rows = recording.trace[recording.trace["engage"] > 0]
    _judge_network(recording, rows)
    _judge_force(rows)
    assert recording.joint("operator/state").entry("energy_given").max() <= BUDGET


def _judge_network(recording, rows):
    """The link did what it was told to (DDS itself drops what is overtaken or doubled), and the cut was counted."""
    answered = rows[np.flatnonzero(np.diff(rows["tool_answered"]) > 0) + 1]
    assert 0.006 <= np.median(answered["tool_age"]) <= 0.02
    values = recording.last_values("haptic_driver")
    assert int(values["exchange_answered"]) < 0.95 * int(values["exchange_sent"])
    assert int(values["exchange_let_go"]) >= 1
    assert values["fault"] == ""


def _judge_force(rows):
    """It falls and rises slowly, and ends where it was."""
    force, place = rows["force_on_handle"][:, 0], rows["position"][:, 0]
    period = np.median(np.diff(rows["deadline"])) * 1e-9
    late = round(1e-3 / period)
    own = np.abs(force[late:] - force[:-late]) - DRIVER["coupling__stiffness"] * np.abs(place[late:] - place[:-late])
    noise = 2.0 * DRIVER["coupling__damping"] * 5e-6 / period  # of the velocity behind an encoder step
    assert own.max() <= SLEW + noise
    let_go, rejoined = _cut(rows["exchange_fade"] == 0.0)
    assert (rejoined - let_go) * period > 1.0
    before, after = np.median(force[let_go - 800 : let_go - 500]), np.median(force[-400:])
    assert before > 0.8 and after == pytest.approx(before, rel=0.2)
    assert np.argmax(force[rejoined:] > 0.9 * after) * period <= 1.0


def _cut(flags):
    """Beginning and end of the last run of flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return edges[-2], edges[-1]
