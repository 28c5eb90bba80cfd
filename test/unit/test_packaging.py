# SPDX-License-Identifier: Apache-2.0
"""What the package says of itself: its commands, dependencies and pins; its launch file; a set-up without a Python."""

import ast
import functools
import re
import runpy
import shutil
import subprocess
import sys
import types
import xml.etree.ElementTree as ElementTree
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import pytest
from lifecycle_msgs.msg import Transition

ROOT = Path(__file__).resolve().parents[2]
EXECUTABLES = sorted(path.name for path in (ROOT / "scripts").iterdir())


def test_launchers_and_entry_points_name_the_same_functions():
    points = {point.name: point.value for point in distribution("haptic_display").entry_points}
    launchers = {name: (ROOT / "scripts" / name).read_text().split("from ")[1].split()[0] for name in EXECUTABLES}
    called = {name: "main" if name == "haptic" else name for name in launchers}
    assert points == {name: f"{module}:{called[name]}" for name, module in launchers.items()}
    for name, function in called.items():
        assert (ROOT / "scripts" / name).read_text().endswith(f" import {function}\n\nraise SystemExit({function}())\n")


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
    files = [*(ROOT / "haptic_device").rglob("*.py"), *(ROOT / "haptic_sim").rglob("*.py")]
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level}
    return {name.split(".")[0] for name in names} - sys.stdlib_module_names - {"haptic_device", "haptic_sim"}


def is_ros(name):
    return name in ("rclpy", "rcl_interfaces", "builtin_interfaces") or name.endswith(("_msgs", "_srvs"))


def test_everything_that_is_imported_is_a_declared_dependency():
    tags = ElementTree.parse(ROOT / "package.xml").getroot().iterfind("exec_depend")
    assert {name for name in imported() if is_ros(name)} <= {tag.text for tag in tags}
    requirements = {re.split(r"[<>=\[; ]", line)[0].lower() for line in distribution("haptic_display").requires}
    providers = packages_distributions()
    for name in imported():
        assert is_ros(name) or {provider.lower() for provider in providers[name]} & requirements, name


def test_pins_are_versions_only():
    """An address in a constraints file would tie every installation to one index."""
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    assert lines == sorted(set(lines), key=str.lower)
    assert all(line.count("==") == 1 and "/" not in line and "@" not in line for line in lines)


class _Recorded:
    """Stands for a class of the launch packages, which no package index offers: keeps what it was given."""

    values = {}

    def __init__(self, *arguments, **options):
        self.arguments, self.options = arguments, options

    def perform(self, context):
        return self.values[self.arguments[0]]


@pytest.fixture
def launched(monkeypatch):
    """launched(argument=value, ...) gives {executable: options} of the nodes that the launch file would start."""
    names = ["LaunchDescription", "DeclareLaunchArgument", "OpaqueFunction", "LaunchConfiguration", "LifecycleNode"]
    names += ["EmitEvent", "RegisterEventHandler", "matches_action", "OnStateTransition", "ChangeState"]
    modules = ["launch", "launch.actions", "launch.events", "launch.substitutions", "launch_ros", "launch_ros.actions"]
    for module in (*modules, "launch_ros.event_handlers", "launch_ros.events", "launch_ros.events.lifecycle"):
        stand_in = types.ModuleType(module)
        vars(stand_in).update({name: _Recorded for name in names})
        monkeypatch.setitem(sys.modules, module, stand_in)
    file = runpy.run_path(str(ROOT / "launch/haptic_display.launch.py"))

    def launch(**given):
        *declared, opaque = file["generate_launch_description"]().arguments[0]
        _Recorded.values = {a.arguments[0]: a.options["default_value"] for a in declared} | given
        actions = opaque.options["function"](None)
        driven = [action for action in actions if "executable" not in action.options]
        return {a.options["executable"]: a.options | {"driven": driven} for a in actions if a not in driven}

    return launch


def test_the_launch_file_starts_device_driver_and_simulation_in_one_namespace(launched):
    nodes = launched()
    assert set(nodes) == {"haptic_driver", "haptic_simulation", "haptic_loopback"} <= set(EXECUTABLES)
    for options in nodes.values():
        assert (options["package"], options["namespace"], options["parameters"]) == ("haptic_display", "haptic", [])


def test_the_launch_file_takes_namespace_parameter_file_hardware_and_recorder(launched):
    nodes = launched(namespace="left", parameters="point.yaml", loopback="false", record="true")
    assert set(nodes) == {"haptic_driver", "haptic_simulation", "haptic_recorder"} <= set(EXECUTABLES)
    assert all(options["namespace"] == "left" for options in nodes.values())
    assert all(options["parameters"] == ["point.yaml"] for options in nodes.values())


def test_the_launch_file_leaves_the_transitions_to_the_nodes_to_itself_or_to_the_user(launched):
    for who, parameters in (("true", []), ("launch", [{"autostart": False}]), ("false", [{"autostart": False}])):
        nodes = launched(autostart=who)
        assert all(options["parameters"] == parameters for options in nodes.values())
        driven = nodes["haptic_driver"]["driven"]
        assert len(driven) == (2 * len(nodes) if who == "launch" else 0)
    events = [
        action.options["event"].options["transition_id"]
        for action in launched(autostart="launch")["haptic_driver"]["driven"]
        if "event" in action.options
    ]
    assert events == [Transition.TRANSITION_CONFIGURE] * len(nodes)


@pytest.fixture
def no_python(tmp_path):
    """A folder of commands whose Pythons all exist and fail, as version-manager shims do."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in ("python3", "python3.11", "python3.12", "python3.13"):
        (folder / name).write_text("#!/bin/sh\nexit 127\n")
        (folder / name).chmod(0o755)
    for name in ("bash", "make", "git", "sh"):
        (folder / name).symlink_to(shutil.which(name))
    return folder


def test_setup_says_what_is_missing_when_no_python_works(no_python, tmp_path):
    clone = tmp_path / "clone"
    clone.mkdir()
    for name in ("Makefile", "setup.py", "setup.cfg", "constraints.txt"):
        shutil.copy2(ROOT / name, clone / name)
    environment = {"PATH": str(no_python), "HOME": str(clone)}
    done = subprocess.run(["make", "setup"], cwd=clone, env=environment, capture_output=True, text=True)
    assert done.returncode != 0
    assert "setup: no Python 3.11, 3.12 or 3.13 with venv found" in done.stderr
    assert not (clone / ".venv").exists()
