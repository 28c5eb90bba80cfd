# SPDX-License-Identifier: Apache-2.0
"""Tools on a live driver that take their time: a map that is interrupted at a wall, and a device recognized."""

import json
import signal

import pytest
import typer
import yaml
from live_tuning import GAINS, disturbed, engaged_pair
from typer.testing import CliRunner

from haptic_device.config_files import find
from haptic_device.description import load_device
from haptic_sim.cli.identify import identify

pytestmark = pytest.mark.timeout(900)


def test_zwidth_live_interrupted_at_a_wall_leaves_the_gains_as_found(start):
    with engaged_pair() as pair:
        tuning = pair[0]
        before = tuning.get(GAINS)
        ended = disturbed(
            pair,
            start,
            lambda: tuning.get(["wall.stiffness"]) != {"wall.stiffness": ()},
            lambda process: process.send_signal(signal.SIGINT),
        )
        assert ended == (130, "haptic zwidth: interrupted; the gains are as they were")
        assert tuning.get(GAINS) == before


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
