# SPDX-License-Identifier: Apache-2.0
"""`haptic zwidth`: a map in a folder, one object with --json, and a sentence for what cannot be."""

import contextlib
import json

import numpy as np
import pytest
from in_process import haptic

from haptic_device.theory import sweep
from haptic_display.cli import zwidth as cli


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
    result = zwidth(tmp_path, operator="worst", lateness=0.0005)  # the latest that there is
    assert result.returncode == 0
    for words in ("Largest stiffness", "late writes", "operator worst"):
        assert words in result.stdout


def test_a_device_description_gives_the_values_that_are_not_given(tmp_path):
    found = json.loads(zwidth(tmp_path, "--json", device="desktop", period=0.00025, coulomb=0.1).stdout)
    assert (found["mass"], found["physical_damping"], found["resolution"]) == (0.1, 3.0, 5e-6)
    assert found["coulomb"] == 0.1


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
