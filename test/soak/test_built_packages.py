# SPDX-License-Identifier: Apache-2.0
"""The package as people get it: built by colcon, installed by pip, every executable, scene and launch file in place."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.timeout(600)
ROOT = Path(__file__).resolve().parents[2]
SHARE = Path("share/haptic_display")
CONFIG = sorted(path.relative_to(ROOT) for path in (ROOT / "config").rglob("*.yaml"))
EXECUTABLES = sorted(path.name for path in (ROOT / "scripts").iterdir())
EXAMPLES = sorted(path.relative_to(ROOT) for path in (ROOT / "examples").rglob("*.py"))
INSTALLED = [SHARE / "package.xml", SHARE / "launch/haptic_display.launch.py"]
INSTALLED += [SHARE / path for path in (*CONFIG, *EXAMPLES, Path("config/layouts/haptic.rviz"))]


@pytest.fixture
def clone(tmp_path):
    """A copy of the files that git has or would take."""
    listing = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(listing, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split("\0")):
        target = tmp_path / "clone" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target)
    return tmp_path / "clone"


def run(*command, folder):
    done = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def installed_in(prefix):
    """The files of the package that are missing or not executable below the prefix: none, if all is well."""
    index = Path("share/ament_index/resource_index/packages/haptic_display")
    missing = [str(path) for path in [index, *INSTALLED] if not (prefix / path).is_file()]
    programs = [Path("lib/haptic_display") / name for name in EXECUTABLES]
    return missing + [str(path) for path in programs if not os.access(prefix / path, os.X_OK)]


def test_colcon_builds_executables_scenes_and_launch_files_into_their_places(clone, tmp_path):
    run(Path(sys.executable).parent / "colcon", "--log-base", "log", "build", folder=clone)
    prefix = clone / "install/haptic_display"
    assert installed_in(prefix) == []
    assert {path.parent.name for path in prefix.rglob("py.typed")} == {"haptic_device", "haptic_display", "haptic_sim"}
    launchers = [prefix / "lib/haptic_display" / name for name in EXECUTABLES]
    assert {path.read_text().splitlines()[0] for path in launchers} == {"#!/usr/bin/env python3"}
    where = f"{sys.executable} -c 'import haptic_sim; print(haptic_sim.__file__)'"
    check = f"{prefix}/lib/haptic_display/haptic check {prefix / SHARE}/config/scenes/wall.yaml"
    sourced = f"source {clone}/install/setup.bash; {where}; {check}"
    module, verdict = run("bash", "-c", sourced, folder=tmp_path).splitlines()
    assert Path(module).is_relative_to(prefix)
    assert verdict.endswith("wall.yaml: ok")
    run(sys.executable, prefix / SHARE / "examples/notebooks/speed_against_error.py", folder=tmp_path)


def test_pip_installs_the_same_files_and_the_commands(clone, tmp_path):
    prefix = tmp_path / "prefix"
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--ignore-installed", "--prefix", prefix]
    run(sys.executable, "-m", "pip", "install", *options, ".", folder=clone)
    assert installed_in(prefix) == []
    assert sorted(path.name for path in (prefix / "bin").iterdir()) == EXECUTABLES
    (described,) = prefix.rglob("METADATA")
    head, _, body = described.read_text().partition("\n\n")
    assert "Description-Content-Type: text/markdown" in head and body.startswith("# haptic_display")
    assert {path.parent.name for path in prefix.rglob("py.typed")} == {"haptic_device", "haptic_display", "haptic_sim"}
