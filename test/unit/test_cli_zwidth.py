# SPDX-License-Identifier: Apache-2.0
"""`haptic zwidth`: a map in a folder, one object with --json, and a sentence for what cannot be."""

import contextlib
import json

import numpy as np
import pytest
from in_process import haptic

from haptic_device.analysis import sweep
from haptic_sim.cli import zwidth as cli


def zwidth(folder, *words, **options):
    """Run the subcommand on a small map, with options changed or added."""
    given = ({} if "--live" in words else {"points": 12, "seconds": 0.2, "out": folder}) | options
    return haptic("zwidth", *words, *(f"--{name.replace('_', '-')}={value}" for name, value in given.items()))


def test_json_tells_the_map_and_both_files_are_there(tmp_path):
    result = zwidth(tmp_path, "--json")
    assert result.returncode == 0
    found = json.loads(result.stdout)
    assert found["cells"] == 144
    assert sum(found["shares"].values()) == pytest.approx(1.0)
    assert found["stiffness_max"].keys() == {"quiet", "not_shaking", "passive", "stable"}
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "map.csv").read_text().splitlines()) == 145


def test_the_table_shows_the_largest_stiffness_over_the_damping(tmp_path):
    result = zwidth(tmp_path, operator="worst", lateness=1e-4)
    assert result.returncode == 0
    assert "Largest stiffness" in result.stdout
    assert "late writes" in result.stdout
    assert "operator worst" in result.stdout


def test_a_device_description_gives_the_values_that_are_not_given(tmp_path):
    found = json.loads(zwidth(tmp_path, "--json", device="desktop", period=0.00025, coulomb=0.1).stdout)
    assert (found["mass"], found["physical_damping"], found["resolution"]) == (0.1, 3.0, 5e-6)
    assert found["coulomb"] == 0.1


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({"period": 0}, "period is 0 s"),
        ({"period": 0, "device": "desktop"}, "period is 0 s"),
        ({"stiffness_max": -5}, "stiffness_max is -5 N/m"),
        ({"damping_max": 0}, "damping_max is 0 N s/m"),
        ({"operator": "strong"}, "operator is 'strong'"),
        ({"lateness": 0.001}, "lateness is 0.001 s, but it must lie between 0 and 0.0005 s"),
        ({"device": "nowhere"}, "nowhere"),
        ({"seconds": 0}, "seconds is 0 s"),
        ({"physical_damping": "nan"}, "physical_damping is nan N s/m"),
        ({"damping": 3}, "--damping needs --live"),
        ({"domain": 3, "namespace": "/a"}, "--domain, --namespace needs --live"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_exit_code_2(tmp_path, options, sentence):
    result = zwidth(tmp_path, **options)
    assert result.returncode == 2
    assert sentence in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ""


def test_live_refuses_what_only_a_map_takes(tmp_path):
    result = zwidth(tmp_path, "--live", mass=1.0, out=tmp_path)
    assert result.returncode == 2 and "with --live, --mass, --out has no meaning" in result.stderr


def test_interrupted_it_keeps_the_rows_that_were_done_and_says_where(tmp_path, monkeypatch):
    @contextlib.contextmanager
    def interrupting(rows):
        def show(done, what):
            if done == 5:
                raise KeyboardInterrupt

        yield show

    monkeypatch.setattr(cli, "progress", interrupting)
    result = zwidth(tmp_path)
    assert result.returncode == 130 and f"rows that were done are in {tmp_path / 'map.csv'}" in result.stderr
    assert np.loadtxt(tmp_path / "map.csv", delimiter=",", skiprows=1).shape == (5 * 12, 5)


def test_what_is_refused_before_the_first_row_leaves_an_earlier_map_as_it_is(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(sweep, "PATIENCE", 0.5)
    (tmp_path / "map.csv").write_text("an earlier map")
    result = zwidth(tmp_path, scheduler="tcp://127.0.0.1:9")
    assert result.returncode == 2 and "no scheduler answers" in result.stderr
    assert (tmp_path / "map.csv").read_text() == "an earlier map"


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({"period": 1}, "servo.rate is 1.0 Hz; at least 500.0 Hz is needed"),
        ({"period": 0.00005}, "servo.rate is 20000.0 Hz; at most 10000.0 Hz is allowed"),
        ({"damping": -1}, "wall.damping[0] is -1.0 N s/m; at least 0.0 N s/m is needed"),
        ({"damping": "nan"}, "damping is nan N s/m"),
        ({"stiffness_max": 0}, "stiffness_max is 0 N/m"),
    ],
)
def test_live_refuses_what_the_driver_cannot_take_before_any_node_is_started(tmp_path, monkeypatch, options, sentence):
    monkeypatch.setattr("haptic_sim.supervision.zwidth.on_pair", None)
    result = zwidth(tmp_path, "--live", **options)
    assert (result.returncode, result.stdout) == (2, "")
    assert sentence in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
