# SPDX-License-Identifier: Apache-2.0
"""Tools on a live driver: gains are left as found, strangers and faults given way to, and a device recognized."""

import json
import time

import pytest
import typer
import yaml
from typer.testing import CliRunner

from haptic_device.share import find
from haptic_sim.cli.bench_nodes import running
from haptic_sim.cli.identify import identify
from haptic_sim.cli.tuning import Tuning

GAINS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping", "passivity.policy", "coupling.stiffness")
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


def test_a_tool_gives_way_to_somebody_else_who_changes_its_gains(pair):
    tuning, domain, namespace = pair
    before, other = tuning.get(GAINS), Tuning(domain, namespace)
    try:
        with pytest.raises(ValueError, match="something else set wall.stiffness"), tuning.as_found(GAINS):
            tuning.set(**WALL)
            other.set(wall__stiffness=(250.0,))
            tuning.set(wall__stiffness=(400.0,))
    finally:
        other.close()
    assert tuning.get(GAINS) == before


def test_a_refusal_of_the_driver_is_its_sentence_and_changes_nothing(pair):
    tuning = pair[0]
    with tuning.as_found(GAINS), pytest.raises(ValueError, match="haptic_driver refused: .*wall.stiffness"):
        tuning.set(**{**WALL, "wall__stiffness": (90000.0,)})


def test_a_driver_in_fault_is_refused(pair):
    tuning = pair[0]
    tuning.trigger("estop")
    try:
        with pytest.raises(ValueError, match="haptic_driver is in fault estop: clear it first"):
            tuning.watch(3.0)
    finally:
        tuning.trigger("reset")
        tuning.trigger("enable")
        tuning.statuses.clear()
        tuning.wait_engaged()


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
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(content | {"actuation_delay": 0.0005}))
    app = typer.Typer()
    app.command()(identify)
    words = ["--loopback", tmp_path / "other.yaml", "--out", tmp_path / "found.yaml", "--seconds", 4, "--rate", 1000]
    began = time.monotonic()
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert result.exit_code == 0, result.stderr
    assert time.monotonic() - began < 100.0
    for values in json.loads(result.stdout)["axes"].values():
        assert values["mass"][0] == pytest.approx(0.15, rel=0.02)
        assert values["damping"][0] == pytest.approx(2.0, rel=0.05)
        assert values["coulomb"][0] == pytest.approx(0.05, abs=0.01)
        assert values["delay"][0] == pytest.approx(0.0005, abs=1e-4)
