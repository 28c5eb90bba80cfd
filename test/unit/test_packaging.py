# SPDX-License-Identifier: Apache-2.0
"""The package as people get it: built by colcon, installed by pip, every executable, scene and launch file in place."""

import ast
import os
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
SHARE = Path("share/haptic_display")
CONFIG = sorted(path.relative_to(ROOT) for path in (ROOT / "config").rglob("*.yaml"))
EXECUTABLES = sorted(path.name for path in (ROOT / "scripts").iterdir())
INSTALLED = [SHARE / "package.xml", SHARE / "launch/haptic_display.launch.py", *(SHARE / path for path in CONFIG)]


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
    where = f"{sys.executable} -c 'import haptic_sim; print(haptic_sim.__file__)'"
    check = f"{prefix}/lib/haptic_display/haptic check {prefix / SHARE}/config/scenes/wall.yaml"
    sourced = f"source {clone}/install/setup.bash; {where}; {check}"
    module, verdict = run("bash", "-c", sourced, folder=tmp_path).splitlines()
    assert Path(module).is_relative_to(prefix)
    assert verdict.endswith("wall.yaml: ok")


def test_pip_installs_the_same_files_and_the_commands(clone, tmp_path):
    prefix = tmp_path / "prefix"
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--ignore-installed", "--prefix", prefix]
    run(sys.executable, "-m", "pip", "install", *options, ".", folder=clone)
    assert installed_in(prefix) == []
    assert sorted(path.name for path in (prefix / "bin").iterdir()) == EXECUTABLES


def test_launchers_and_entry_points_name_the_same_functions():
    points = {point.name: point.value for point in distribution("haptic_display").entry_points}
    launchers = {name: (ROOT / "scripts" / name).read_text().split("from ")[1].split()[0] for name in EXECUTABLES}
    assert points == {name: f"{module}:main" for name, module in launchers.items()}


def test_package_description_and_python_metadata_agree():
    package = ElementTree.parse(ROOT / "package.xml").getroot()
    metadata = distribution("haptic_display").metadata
    assert package.get("format") == "3"
    assert package.findtext("export/build_type") == "ament_python"
    for tag, field in (("name", "Name"), ("version", "Version"), ("description", "Summary"), ("license", "License")):
        assert package.findtext(tag) == metadata[field].replace("-", "_" if tag == "name" else "-")


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
    events = [action.options["event"].options["transition_id"] for action in launched(autostart="launch")[
        "haptic_driver"]["driven"] if "event" in action.options]  # fmt: skip
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


def test_setup_says_what_is_missing_when_no_python_works(no_python, clone):
    environment = {"PATH": str(no_python), "HOME": str(clone)}
    done = subprocess.run(["make", "setup"], cwd=clone, env=environment, capture_output=True, text=True)
    assert done.returncode != 0
    assert "setup: no Python 3.11, 3.12 or 3.13 with venv found" in done.stderr
    assert not (clone / ".venv").exists()
