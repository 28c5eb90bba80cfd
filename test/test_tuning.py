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
from typer.testing import CliRunner

from haptic_device.share import find
from haptic_sim.cli.bench_nodes import running
from haptic_sim.cli.identify import identify
from haptic_sim.cli.tuning import Tuning

pytestmark = pytest.mark.live

GAINS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping", "passivity.policy", "coupling.stiffness")
FREE = ("coupling.stiffness", "coupling.damping", "coupling.rotational_stiffness", "coupling.rotational_damping")
FREE += ("cancellation.ratio",)
WALL = {
    "wall__normals": (1.0, 0.0), "wall__offsets": (-0.05,), "wall__stiffness": (300.0,), "wall__damping": (0.1,),
}  # fmt: skip


@pytest.fixture(scope="module")
def pair():
    """Driver and loopback with a hand that follows, engaged."""
    with running(None, None, {"servo.rate": 1000.0}, {"motion.name": "follow"}) as (domain, namespace, check):
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
    """How `haptic zwidth --live` ends if act(process) comes once the condition holds.

    Begun anew where this machine stalled so long that the device cut the motor, which is a fault of its own.
    """
    end = time.monotonic() + 60.0
    while True:
        process = zwidth_live(pair, start)
        while process.poll() is None and not condition():
            time.sleep(0.05)
        act(process)
        ended = sentence_of(process)
        if "device_watchdog" not in ended[1] or time.monotonic() > end:
            return ended
        pair[0].recover()


def sentence_of(process):
    """Exit code and the one line that the command says at its end."""
    said, complained = process.communicate(timeout=100.0)
    assert said == ""
    [sentence] = complained.strip().splitlines()
    return process.returncode, sentence


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
        lambda process: tuning.set(coupling__stiffness=250.0 if process.poll() is None else 1000.0),
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


def most_taken(tuning):
    """Largest stiffness that the driver names when it refuses, at the lateness of its writes."""
    with pytest.raises(ValueError) as refused:
        tuning.set(**WALL | {"wall__stiffness": (90000.0,)})
    sentence = r"wall.stiffness 90000 N/m .* needs b > .* the device has 3: at most (\d+) N/m"
    return float(re.search(sentence, str(refused.value))[1])


def test_under_enforce_a_wall_keeps_its_bound_with_cancellation_before_it_and_nothing_beyond_it_is_taken(pair):
    tuning, end = pair[0], time.monotonic() + 60.0
    bound = 2.0 * (3.0 - 0.1) * 1000.0
    with tuning.as_found((*GAINS, *FREE, "cancellation.band")):
        tuning.set(**{name.replace(".", "__"): 0.0 for name in FREE}, passivity__policy="enforce")
        tuning.set(cancellation__ratio=0.7, cancellation__band=0.02)
        with pytest.raises(ValueError, match=f"wall.stiffness {1.01 * bound:g} N/m .* needs b > .* the device has 3: "):
            tuning.set(**WALL | {"wall__stiffness": (1.01 * bound,)})
        while not accepted(tuning, 0.95 * most_taken(tuning)):
            assert time.monotonic() < end, "writes came later each time"
        assert tuning.get(["cancellation.ratio"]) == {"cancellation.ratio": 0.7}


def accepted(tuning, stiffness):
    """Whether the driver takes a wall of this stiffness."""
    try:
        tuning.set(**WALL | {"wall__stiffness": (stiffness,)})
    except ValueError:
        return False
    return True


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
    tuning.watch(1.0, lambda elapsed: (0.02, 0.01, 0.0))
    assert tuning.truths[-1]["x"][0] == pytest.approx(0.02, abs=2e-3)
    tuning.watch(1.0, lambda elapsed: (0.0, 0.0, 0.0))


def test_a_namespace_without_nodes_is_told_in_a_sentence(ros_domain, monkeypatch):
    monkeypatch.setattr("haptic_sim.cli.tuning.APPEARANCE", 0.3)
    tuning = Tuning(ros_domain, "/nobody")
    try:
        with pytest.raises(ValueError, match="no loopback is heard of in /nobody; start one"):
            tuning.wait_engaged()
    finally:
        tuning.close()


def test_identify_recognizes_a_live_device_that_the_driver_was_not_told(tmp_path, monkeypatch):
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
    axes = json.loads(result.stdout)["axes"]
    for name, scale in (("x", 1.0), ("y", 1.0), ("theta", 1e-3)):
        assert axes[name]["mass"][0] == pytest.approx(0.15 * scale, rel=0.02)
        assert axes[name]["damping"][0] == pytest.approx(0.003 if name == "theta" else 2.0, rel=0.05)
        assert axes[name]["coulomb"][0] == pytest.approx(0.0003 if name == "theta" else 0.05, abs=0.01 * scale)
        assert axes[name]["delay"][0] == pytest.approx(0.0005, abs=1e-4)
