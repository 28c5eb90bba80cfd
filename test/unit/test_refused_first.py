# SPDX-License-Identifier: Apache-2.0
"""Commands that take long say before they begin what they cannot do."""

from pathlib import Path

import pytest
from in_process import haptic

from haptic_sim.cli.compare import compare
from haptic_sim.cli.replay import As, replay
from haptic_sim.supervision import processes

BAG = Path("no such bag")


def test_more_operating_points_than_a_page_shows_are_refused_before_the_first_is_played(tmp_path):
    with pytest.raises(ValueError, match="7 operating points are given; at most 6"):
        compare(BAG, ["demo"] * 7, As.target, 0.0, tmp_path / "out", None)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("given", "option"),
    [
        ({"as_": As.device}, "--as device"),
        ({"params": "demo"}, "--params"),
        ({"delay": 0.01}, "--delay"),
        ({"out": Path("out")}, "--out"),
    ],
)
@pytest.mark.parametrize("mode", ["live", "check"])
def test_what_a_mode_of_replay_does_not_take_is_refused_by_name(given, option, mode):
    plain = {"as_": As.target, "check": False, "live": False, "params": None, "delay": 0.0, "out": None}
    with pytest.raises(ValueError, match=f"replay --{mode} takes no {option}:"):
        replay(BAG, **plain | {mode: True} | given, namespace=None)


BAD = {
    "a name": ("coupling: {stifness: 1.0}", "coupling.stifness is not a parameter of haptic_driver; did you mean"),
    "a value": ("coupling: {stiffness: -1.0}", "coupling.stiffness is -1.0 N/m; at least 0.0 N/m is needed"),
    "a device": ("device: nowhere", "haptic_driver: device 'nowhere' is neither the file"),
    "no YAML": ("coupling: [", "is not YAML"),
}


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize("view", [False, True])
def test_a_demo_refuses_a_bad_file_before_it_starts_a_node_or_makes_a_folder(tmp_path, kind, view, monkeypatch):
    monkeypatch.setattr(processes.Nodes, "start", lambda nodes, program: pytest.fail(f"{program.name} was started"))
    given, sentence = BAD[kind]
    file = tmp_path / "bad.yaml"
    file.write_text(f"/**/haptic_driver:\n  ros__parameters:\n    {given}\n")
    done = haptic("demo", "--params", file, "--out", tmp_path / "run", *(["--view"] if view else []))
    assert done.returncode == 1 and done.stderr.startswith(f"haptic: {file}: ") and sentence in done.stderr
    assert not (tmp_path / "run").exists()
