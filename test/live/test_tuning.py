# SPDX-License-Identifier: Apache-2.0
"""Tools on a live driver: gains are left as found, strangers and faults given way to, and a device recognized."""

import json
import re
import signal
import subprocess
import sys
import time

import pytest
import typer
import yaml
from lockstep_systems import values
from typer.testing import CliRunner

from haptic_device import operating
from haptic_device.device import load_device
from haptic_device.share import find
from haptic_sim.cli.bench_nodes import running
from haptic_sim.cli.identify import identify
from haptic_sim.cli.tuning import Tuning

pytestmark = pytest.mark.timeout(900)

GAINS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping", "passivity.policy", "coupling.stiffness")
FREE = ("coupling.stiffness", "coupling.damping", "coupling.rotational_stiffness", "coupling.rotational_damping")
FREE += ("cancellation.ratio",)
LIMIT = 240.0  # [s] for anything; no assertion
WALL = {
    "wall__normals": (1.0, 0.0), "wall__offsets": (-0.05,), "wall__stiffness": (300.0,), "wall__damping": (0.1,),
}  # fmt: skip


@pytest.fixture(scope="module")
def pair():
    """Driver and loopback with a hand that follows, engaged; no fault if the machine holds them up for a second."""
    patient = {"servo.rate": 1000.0, "fault.silence": 1.0, "fault.unattended": 0.0}
    device = {"motion.name": "follow", "motor_watchdog": 2.0}
    with running(None, None, patient, device) as (domain, namespace, check):
        tuning = Tuning(domain, namespace)
        try:
            tuning.wait_engaged(check)
            yield tuning, domain, namespace
        finally:
            tuning.close()


def test_gains_are_as_they_were_after_an_interrupt(pair):
    tuning = pair[0]
    before = tuning.get(GAINS)
    with pytest.raises(KeyboardInterrupt), tuning.as_found(GAINS):
        tuning.set(**WALL, passivity__policy="off", coupling__stiffness=10.0)
        assert tuning.get(["wall.stiffness"]) == {"wall.stiffness": (300.0,)}
        raise KeyboardInterrupt
    assert tuning.get(GAINS) == before


def test_gains_that_the_policy_would_not_take_any_more_are_put_back_too(pair):
    tuning = pair[0]
    before = tuning.get(GAINS)
    tuning.set(passivity__policy="off", coupling__stiffness=50000.0)
    tuning.set(passivity__policy="enforce")
    beyond = tuning.get(GAINS)
    with tuning.as_found(GAINS):
        tuning.set(coupling__stiffness=10.0)
    assert tuning.get(GAINS) == beyond
    tuning.set(**{name.replace(".", "__"): value for name, value in before.items()})


def zwidth_live(pair, start):
    """`haptic zwidth --live` as a person starts it, on the nodes of the pair."""
    words = ["zwidth", "--live", "--device", "desktop", "--domain", pair[1], "--namespace", pair[2]]
    command = [sys.executable, "-m", "haptic_sim.cli.main", *words]
    return start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def disturbed(pair, start, condition, act):
    """How `haptic zwidth --live` ends if act(process) comes once condition() holds."""
    process, end = zwidth_live(pair, start), time.monotonic() + LIMIT
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, f"{condition} did not come within {LIMIT:g} s"
        time.sleep(0.05)
    act(process)
    return sentence_of(process)


def sentence_of(process):
    """Exit code and the one line that the command says at its end."""
    said, complained = process.communicate(timeout=LIMIT)
    assert said == ""
    sentences = complained.strip().splitlines()
    assert len(sentences) == 1, complained
    return process.returncode, sentences[0]


def test_zwidth_live_interrupted_at_a_wall_leaves_the_gains_as_found(pair, start):
    tuning = pair[0]
    before = tuning.get(GAINS)
    ended = disturbed(
        pair, start, lambda: tuning.get(["wall.stiffness"]) != {"wall.stiffness": ()},
        lambda process: process.send_signal(signal.SIGINT),
    )  # fmt: skip
    assert ended == (130, "haptic zwidth: interrupted; the gains are as they were")
    assert tuning.get(GAINS) == before


def test_zwidth_live_gives_way_to_somebody_else_who_changes_its_gains(pair, start):
    tuning = pair[0]
    before = tuning.get(GAINS)
    ended = disturbed(
        pair, start, lambda: tuning.get(["coupling.stiffness"]) == {"coupling.stiffness": 0.0},
        lambda process: tuning.set(coupling__stiffness=250.0),
    )  # fmt: skip
    told = "something else set coupling.stiffness to 250.0 meanwhile, this command had set 0.0"
    assert ended == (2, f"haptic zwidth: {told}")
    assert tuning.get(GAINS) == before


def test_zwidth_live_refuses_a_driver_in_fault(pair, start):
    tuning = pair[0]
    tuning.trigger("estop")
    try:
        ended = sentence_of(zwidth_live(pair, start))
    finally:
        tuning.recover()
    assert ended[0] == 2
    assert re.fullmatch(r"haptic zwidth: haptic_driver is in fault \w+: clear it first .*", ended[1])


def test_a_tool_gives_way_to_somebody_else_who_changes_its_gains(pair):
    tuning, domain, namespace = pair
    before, other = tuning.get(GAINS), Tuning(domain, namespace)
    try:
        with pytest.raises(ValueError, match="something else set wall.stiffness"), tuning.as_found(GAINS):
            tuning.set(**WALL, passivity__policy="off")
            other.set(wall__stiffness=(250.0,))
            tuning.set(wall__stiffness=(400.0,))
    finally:
        other.close()
    assert tuning.get(GAINS) == before


def test_a_refusal_of_the_driver_is_its_sentence_and_changes_nothing(pair):
    tuning = pair[0]
    with tuning.as_found(GAINS), pytest.raises(ValueError, match="haptic_driver refused: .*wall.stiffness"):
        tuning.set(**{**WALL, "wall__stiffness": (90000.0,)})


def test_under_enforce_nothing_beyond_a_walls_bound_is_taken_and_a_soft_wall_is_with_cancellation_before_it(pair):
    tuning, bound = pair[0], 2.0 * (3.0 - 0.1) * 1000.0
    with tuning.as_found((*GAINS, *FREE, "cancellation.band")):
        tuning.set(**{name.replace(".", "__"): 0.0 for name in FREE}, passivity__policy="enforce")
        tuning.set(cancellation__ratio=0.7, cancellation__band=0.02)
        with pytest.raises(ValueError, match=f"wall.stiffness {1.01 * bound:g} N/m .* needs b > .* the device has 3: "):
            tuning.set(**WALL | {"wall__stiffness": (1.01 * bound,)})
        tuning.set(**WALL | {"wall__stiffness": (1.0,)})  # which writes of any lateness leave passive
        found = {"wall.stiffness": (1.0,), "cancellation.ratio": 0.7}
        assert tuning.get(found) == found


def test_just_within_the_bound_a_late_driver_names_a_wall_is_taken_with_cancellation_before_it():
    def refused(stiffness, late):
        walls = {"wall__normals": (1.0, 0.0), "wall__offsets": (-0.05,), "wall__damping": (0.1,)}
        gains = values(
            "haptic_driver", **walls, wall__stiffness=(stiffness,), **{name.replace(".", "__"): 0.0 for name in FREE}
        ) | {"servo.rate": 1000.0, "cancellation.ratio": 0.7, "cancellation.band": 0.02}
        return operating.refusal(operating.settings_from(load_device("desktop"), gains)[0], late)

    for late in (0.0, 1e-4, 5e-4):
        most = float(re.search(r"the device has 3: at most (\d+) N/m", refused(90000.0, late))[1])
        assert refused(0.999 * most, late) == "" and refused(1.01 * most, late)


def test_a_driver_in_fault_is_refused(pair):
    tuning = pair[0]
    tuning.trigger("estop")
    try:
        with pytest.raises(ValueError, match="haptic_driver is in fault estop: clear it first"):
            tuning.watch(3.0)
    finally:
        tuning.recover()


def test_the_hand_goes_where_it_is_aimed(pair):
    tuning = pair[0]
    for x, y in ((0.02, 0.01), (0.0, 0.0)):
        end = time.monotonic() + LIMIT
        while abs(tuning.truths[-1]["x"][0] - x) > 2e-3 or abs(tuning.truths[-1]["y"][0] - y) > 2e-3:
            assert time.monotonic() < end, f"the hand did not come to {x}, {y} within {LIMIT:g} s"
            tuning.aim((x, y, 0.0))
            tuning.look()
            time.sleep(0.01)


def test_a_namespace_without_nodes_is_told_in_a_sentence(ros_domain, monkeypatch):
    monkeypatch.setattr("haptic_sim.cli.tuning.APPEARANCE", 0.3)
    tuning = Tuning(ros_domain, "/nobody")
    try:
        with pytest.raises(ValueError, match="no loopback is heard of in /nobody; start one"):
            tuning.wait_engaged()
    finally:
        tuning.close()


def test_identify_writes_what_it_found_of_a_live_device_and_tells_it_from_the_one_that_the_driver_was_told(
    tmp_path, monkeypatch
):
    monkeypatch.delenv("ROS_DOMAIN_ID")  # a pair of its own needs a domain of its own
    content = yaml.safe_load(find("devices", "desktop").read_text())
    for axis in content["axes"][:2]:
        axis |= {"mass": 0.15, "damping": 2.0, "coulomb": 0.05}
    content["axes"][2] |= {"mass": 0.00015, "damping": 0.003, "coulomb": 0.0003}
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(content | {"actuation_delay": 0.0005}))
    app = typer.Typer()
    app.command()(identify)
    words = ["--loopback", tmp_path / "other.yaml", "--out", tmp_path / "found.yaml", "--seconds", 4, "--rate", 1000]
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert result.exit_code == 0, result.stderr
    axes, written = json.loads(result.stdout)["axes"], load_device(str(tmp_path / "found.yaml"))
    told, true = load_device("desktop"), load_device(str(tmp_path / "other.yaml"))
    for had, has, axis in zip(told.axes, true.axes, written.axes, strict=True):
        assert abs(axis.mass - has.mass) < abs(axis.mass - had.mass)
        assert axis.mass == pytest.approx(axes[axis.name]["mass"][0], abs=1e-9)
        assert axis.damping == pytest.approx(max(0.0, axes[axis.name]["damping"][0]), abs=1e-9)
