# SPDX-License-Identifier: Apache-2.0
"""What the package says of itself: its commands, dependencies and pins; a set-up without a Python."""

import ast
import functools
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {"haptic_device", "haptic_display", "haptic_sim"}
EXECUTABLES = sorted(path.name for path in (ROOT / "scripts").iterdir())


def test_launchers_and_entry_points_name_the_same_functions():
    points = {point.name: point.value for point in distribution("haptic_display").entry_points}
    launchers = {name: (ROOT / "scripts" / name).read_text().split("from ")[1].split()[0] for name in EXECUTABLES}
    called = {name: "main" if name == "haptic" else name for name in launchers}
    assert points == {name: f"{module}:{called[name]}" for name, module in launchers.items()}


def test_package_description_and_python_metadata_agree():
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    metadata = distribution("haptic_display").metadata
    assert package.get("format") == "3"
    assert package.findtext("export/build_type") == "ament_python"
    for tag, field in (("name", "Name"), ("version", "Version"), ("description", "Summary"), ("license", "License")):
        assert package.findtext(tag) == metadata[field].replace("-", "_" if tag == "name" else "-")


@functools.cache
def imported():
    """Top-level names of everything outside the standard library that the package's modules import."""
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level}
    return {name.split(".")[0] for name in names} - sys.stdlib_module_names - PACKAGES


def is_ros(name):
    return name in ("rclpy", "rcl_interfaces", "builtin_interfaces") or name.endswith(("_msgs", "_srvs"))


def test_everything_that_is_imported_is_a_declared_dependency():
    tags = ElementTree.parse(ROOT / "package.xml").getroot().iterfind("exec_depend")
    assert {name for name in imported() if is_ros(name)} <= {tag.text for tag in tags}
    requirements = {re.split(r"[<>=\[; ]", line)[0].lower() for line in distribution("haptic_display").requires}
    providers = packages_distributions()
    for name in imported():
        assert is_ros(name) or {provider.lower() for provider in providers.get(name, [name])} & requirements, name


def test_pins_are_versions_only():
    """An address in a constraints file would tie every installation to one index."""
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert lines == sorted(set(lines), key=str.lower)
    assert all(line.count("==") == 1 and "/" not in line and "@" not in line for line in lines)


def test_setup_says_what_is_missing_when_no_python_works(tmp_path):
    """All Pythons are there and fail, as the shims of version managers do."""
    folder, clone = tmp_path / "bin", tmp_path / "clone"
    folder.mkdir()
    clone.mkdir()
    for name in ("python3", "python3.11", "python3.12", "python3.13"):
        (folder / name).write_text("#!/bin/sh\nexit 127\n")
        (folder / name).chmod(0o755)
    for name in ("bash", "make", "git", "sh"):
        (folder / name).symlink_to(shutil.which(name))
    for name in ("Makefile", "setup.py", "setup.cfg", "constraints.txt"):
        shutil.copy2(ROOT / name, clone / name)
    environment = {"PATH": str(folder), "HOME": str(clone)}
    done = subprocess.run(["make", "setup"], cwd=clone, env=environment, capture_output=True, text=True)
    assert done.returncode != 0
    assert "setup: no Python 3.11, 3.12 or 3.13 with venv found" in done.stderr
    assert not (clone / ".venv").exists()
