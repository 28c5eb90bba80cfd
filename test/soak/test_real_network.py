# SPDX-License-Identifier: Apache-2.0
"""Driver and loopback on one host, the simulation on another, a bad network between: two network namespaces.

Where none can be made, the network is haptic_relay, stopped for the cut; the last lines of the run say why.
"""

import contextlib
import signal
import time

import bad_link
import numpy as np
import pytest
from live_nodes import command, page_path
from waiting import exit_code, until

from haptic_device.realtime import shared_memory
from haptic_device.recording import load
from haptic_display.run.processes import Program
from haptic_display.run.system import FAR

pytestmark = pytest.mark.timeout(600)

PRESSING = {"motion__name": "hold", "motion__start": [0.007, 0.0, 0.0]}  # 3 mm deep in the wall of the scene
DRIVER = {
    "auto_enable": True,
    "auto_enable_wait": 60.0,
    "servo__rate": 2000.0,
    "coupling__stiffness": 2000.0,
    "coupling__damping": 2.0,
    "coupling__rotational_stiffness": 1.0,
    "coupling__rotational_damping": 0.002,
    "engage__force": 20.0,
}
SLEW, BUDGET = 0.5, 0.005  # [N/ms], [J]
LEAST_AGE = 0.006  # [s] that half of the answers are older than, however fast the machine is
CONTACT = 0.8  # [N] and more
LATEST = 1000  # ticks without a force


def motor_x():
    """Force [N] that the driver last wrote into the device page, which all namespaces share."""
    if not page_path().exists():
        return 0.0
    block = np.zeros(shared_memory.SERVO_WORDS, np.int64)
    shared_memory.read_servo(np.fromfile(page_path(), np.int64), block)
    return float(block[5:6].view(np.float64)[0])


class Relayed:
    """The same network between nodes of one host."""

    def __init__(self, start):
        values = {"delay": 8e-3, "jitter": 4e-3, "loss": 0.05, "duplicates": 0.05}  # of both ways together
        self._relay = start(Program("haptic_relay", "haptic_sim.node.network_emulator", values).command())

    def inside(self, where, words):
        """Command line of a node on its side of the relay."""
        renamed = [word for old, new in FAR.items() for word in ("-r", f"{old}:={new}")]
        return [*words, *renamed] if where == "far" else words

    def set(self, cut):
        """Cuts the network, or joins it."""
        self._relay.send_signal(signal.SIGSTOP if cut else signal.SIGCONT)


@pytest.fixture
def link(start, last_lines):
    """The link between two hosts, or what comes nearest to it here; the run's last lines say which, and why."""
    network = bad_link.Link(delay=4e-3, jitter=2e-3, loss=0.05, duplicates=0.05)
    with contextlib.ExitStack() as stack:
        try:
            joined, is_what = stack.enter_context(network), "two namespaces"
        except OSError as reason:
            joined, is_what = Relayed(start), f"a relay, because {reason}"
        last_lines.append(f"network: {is_what}")
        yield joined


@pytest.fixture
def across(link, start, monkeypatch, tmp_path):
    """The four nodes, started on their sides of the link; what ends them all, the recorder first, and the bag."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    nodes = {
        "far": [command("haptic_simulation", scene="wall")],
        "near": [
            command("haptic_loopback", **PRESSING),
            Program("haptic_recorder", "haptic_device.nodes.recorder", {"bag": str(tmp_path / "bag")}).command(),
            command("haptic_driver", **DRIVER),
        ],
    }
    inside = [link.inside(where, words) for where in nodes for words in nodes[where]]
    with open(tmp_path / "log", "w") as log:
        started = [start(words, stdout=log, stderr=log) for words in inside]

    def end():
        for process in (started[2], *started):
            process.send_signal(signal.SIGINT)
        return [exit_code(process) for process in started]

    return end, tmp_path / "bag"


def test_behind_a_bad_network_and_a_cut_contact_is_passive_and_comes_back_without_a_kick(link, across):
    end, bag = across

    def wait(condition, what):
        until(condition, what, look=lambda: time.sleep(0.1), said=lambda: _said(bag))  # a bag is read in that time

    wait(lambda: motor_x() > CONTACT and _recorded(bag, _pressed), "contact")
    link.set(cut=True)
    wait(lambda: abs(motor_x()) < 0.05 and _recorded(bag, _let_go), "letting go")
    link.set(cut=False)
    wait(lambda: motor_x() > CONTACT and _recorded(bag, _pressed_again), "contact again")
    assert end() == [0] * 4
    recording = load(bag)
    rows = recording.trace[recording.trace["engage"] > 0]
    _judge_network(recording, rows)
    _judge_force(rows)
    assert recording.joint("operator/state").entry("energy_given").max() <= BUDGET


def _said(bag):
    """The motor, the driver's last words, and what the nodes printed."""
    try:
        values = load(bag).last_values("haptic_driver")
    except (ValueError, OSError, KeyError) as error:
        values = f"the bag cannot be read: {error}"
    printed = (bag.parent / "log").read_text().strip().splitlines()[-3:]
    return f"motor {motor_x():.3g} N; {values}; printed last: {printed}"


def _recorded(bag, found):
    """Whether found(rows) holds for the ticks with forces on that are on the disk."""
    try:
        rows = load(bag).trace
        return found(rows[rows["engage"] > 0])
    except (ValueError, OSError, KeyError):
        return False


def _pressed(rows):
    return rows["force_on_handle"][:, 0].max() > CONTACT


def _let_go(rows):
    begin, end = _cut(rows["exchange_fade"] == 0.0)
    return end == len(rows) and end - begin > LATEST


def _pressed_again(rows):
    return _pressed(rows[_cut(rows["exchange_fade"] == 0.0)[1] :])


def _judge_network(recording, rows):
    """The link did what it was told to, what it lost, doubled or let be overtaken was not used, and the cut counted."""
    answered = rows["tool_answered"][rows["tool_answered"] > 0]
    assert np.all(np.diff(answered) >= 0) and np.any(np.diff(answered) > 1)
    new = rows[np.flatnonzero(np.diff(rows["tool_answered"]) > 0) + 1]
    assert np.median(new["tool_age"]) >= LEAST_AGE
    values = recording.last_values("haptic_driver")
    assert int(values["exchange_answered"]) < 0.95 * int(values["exchange_sent"])
    assert int(values["exchange_released"]) >= 1
    assert values["fault"] == ""


def _judge_force(rows):
    """It falls and rises slowly, and ends where it was; all by the ticks' own times."""
    force, place, time_s = rows["force_on_handle"][:, 0], rows["position"][:, 0], rows["deadline"] * 1e-9
    before = np.searchsorted(time_s, time_s - 1e-3 + 1e-9, side="right") - 1  # a millisecond; more over missed ticks
    later = before >= 0
    before, elapsed = before[later], (time_s[later] - time_s[before[later]]) * 1e3
    own = np.abs(force[later] - force[before]) - DRIVER["coupling__stiffness"] * np.abs(place[later] - place[before])
    noise = 2.0 * DRIVER["coupling__damping"] * 5e-6 * DRIVER["servo__rate"]  # of the velocity behind an encoder step
    assert np.max(own - SLEW * elapsed) <= noise
    let_go, rejoined = _cut(rows["exchange_fade"] == 0.0)
    assert 0 < let_go < rejoined < len(rows)
    assert np.abs(force[let_go:rejoined]).max() < 0.05
    assert force[:let_go].max() > CONTACT and force[rejoined:].max() > CONTACT


def _cut(flags):
    """Beginning and end of the longest run of flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    longest = np.argmax(np.diff(edges)[::2])
    return edges[2 * longest], edges[2 * longest + 1]
