# SPDX-License-Identifier: Apache-2.0
"""The launch file and the examples that include it: what they start, with what, and what they refuse."""

import ast
import runpy
import sys
import types
from pathlib import Path

import pytest
from lifecycle_msgs.msg import Transition

from haptic_sim.scene.needs import TOGETHER

ROOT = Path(__file__).resolve().parents[2]


class _Recorded:
    """Stands for a class of the launch packages, which no package index offers: keeps what it was given."""

    def __init__(self, *arguments, **options):
        self.arguments, self.options = arguments, options

    def perform(self, context):
        return context.launch_configurations[self.arguments[0]]

    def evaluate(self, context):
        """Of IfCondition: what it takes for true and for false."""
        return {"true": True, "1": True, "false": False, "0": False}[self.arguments[0].lower()]


class _Module(types.ModuleType):
    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return _Recorded


STAND_INS = [f"launch{part}" for part in ("", ".actions", ".conditions", ".events", ".substitutions")]
STAND_INS += ["launch.launch_description_sources", "launch_ros"]
STAND_INS += [f"launch_ros.{part}" for part in ("actions", "event_handlers", "events", "events.lifecycle")]
STAND_INS += [f"launch_ros.{part}" for part in ("parameter_descriptions", "substitutions", "utilities")]


@pytest.fixture
def launch_file(monkeypatch):
    """launch_file(path) gives the launch description of a file of ours."""
    for module in STAND_INS:
        monkeypatch.setitem(sys.modules, module, _Module(module))
    sys.modules["launch_ros.utilities"].prefix_namespace = lambda base, namespace: namespace
    return lambda path: runpy.run_path(str(ROOT / path))["generate_launch_description"]()


def actions_of(description, given):
    """What a launch description with these arguments comes to."""
    *declared, opaque = description.arguments[0]
    values = {action.arguments[0]: action.options["default_value"] for action in declared}
    assert given.keys() <= values.keys()
    for action in declared:
        name, choices = action.arguments[0], action.options["choices"]
        assert choices is None or (given.get(name, values[name]) in choices), "launch itself refuses it"
    return opaque.options["function"](types.SimpleNamespace(launch_configurations=values | given))


@pytest.fixture
def launched(launch_file):
    """launched(argument=value, ...) gives {executable: options} of the nodes that the launch file would start."""

    def launch(**given):
        actions = actions_of(launch_file("launch/haptic_display.launch.py"), given)
        driven = [action for action in actions if "executable" not in action.options]
        return {a.options["executable"]: a.options | {"driven": driven} for a in actions if a not in driven}

    return launch


def plain(parameters):
    """The parameters of a node: files, then what the arguments give, texts as such."""

    def text(value):
        return value.arguments[0] if isinstance(value, _Recorded) else value

    return [{k: text(v) for k, v in each.items()} if isinstance(each, dict) else each for each in parameters]


@pytest.mark.parametrize("file", [ROOT / "launch/haptic_display.launch.py", *(ROOT / "examples").glob("*.launch.py")])
def test_a_launch_file_runs_in_the_python_of_ros2_which_has_not_our_libraries(file):
    def foreign(path):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        found = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        found |= {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
        known = {*sys.stdlib_module_names, "launch", "launch_ros", "lifecycle_msgs", "yaml"}
        return {name for name in found if name.split(".")[0] not in known}

    ours = {"haptic_device.config.files", "haptic_device.config.yaml_reader", "haptic_device.os_errors"}
    ours |= {"haptic_device.config.parameter_sections", "haptic_sim.scene.motion", "haptic_sim.scene.needs"}
    assert foreign(file) <= ours
    for module in (*ours, *(f"haptic_{folder}.__init__" for folder in ("device", "device.config", "sim", "sim.scene"))):
        assert foreign(ROOT / f"{module.replace('.', '/')}.py") <= ours


def test_the_launch_file_starts_device_driver_and_simulation_in_one_namespace_and_what_else_it_is_told(
    launched, tmp_path
):
    file, nodes = tmp_path / "point.yaml", launched()
    file.touch()
    assert set(nodes) == {"haptic_driver", "haptic_simulation", "haptic_loopback"}
    assert all((options["namespace"], options["parameters"]) == ("haptic", []) for options in nodes.values())
    nodes = launched(namespace="left", parameters=str(file), loopback="0", record="true", view="1", enable="True")
    assert set(nodes) == {"haptic_driver", "haptic_simulation", "haptic_recorder", "haptic_viewer"}
    assert all(options["namespace"] == "left" for options in nodes.values())
    enabled = nodes.pop("haptic_driver")["parameters"]
    assert enabled == [str(file), {"auto_enable": True, "auto_enable_wait": TOGETHER}]
    assert all(options["parameters"] == [str(file)] for options in nodes.values())


def test_scene_and_device_of_the_launch_file_reach_the_nodes_after_the_parameter_file(launched, tmp_path):
    """Later files of parameters win; the hand moves as the scene suggests, as in `haptic demo`."""
    own = tmp_path / "own.yaml"
    own.write_text("motion: {name: hold, moving: 'off'}")
    nodes = launched(parameters="demo", scene=str(own), device="undamped")
    nodes = {name: plain(options["parameters"])[1:] for name, options in nodes.items()}
    assert nodes == {
        "haptic_driver": [{"device": "undamped"}],
        "haptic_simulation": [{"scene": str(own)}],
        "haptic_loopback": [{"device": "undamped", "motion.name": "hold", "motion.moving": "off"}],
    }


@pytest.mark.parametrize("told", ["argument", "file"])
def test_the_launch_file_starts_what_serves_the_device_that_the_driver_has(launched, tmp_path, told):
    for device, serving in (("moteus_knob", {"haptic_bridge"}), ("own_device", set())):
        (tmp_path / "point.yaml").write_text(f"/**/haptic_driver: {{ros__parameters: {{device: {device}}}}}")
        nodes = launched(**{"device": device} if told == "argument" else {"parameters": str(tmp_path / "point.yaml")})
        assert set(nodes) == {"haptic_driver", "haptic_simulation"} | serving


def test_a_device_counts_for_the_launch_file_where_its_section_reaches_the_driver(launched, tmp_path):
    bridge, given = {"haptic_bridge"}, "ros__parameters: {device: moteus_knob}"
    for section, served in (
        (f"/**: {{{given}}}", bridge),
        (f"/left/haptic_driver: {{{given}}}", bridge),
        (f"left: {{haptic_driver: {{{given}}}}}", bridge),
        (f"/right/haptic_driver: {{{given}}}", {"haptic_loopback"}),
        (f"/**/haptic_simulation: {{{given}}}", {"haptic_loopback"}),
    ):
        (tmp_path / "point.yaml").write_text(section)
        nodes = launched(parameters=str(tmp_path / "point.yaml"), namespace="left")
        assert set(nodes) == {"haptic_driver", "haptic_simulation"} | served, section


def test_what_is_not_there_or_no_yaml_is_refused_by_the_launch_file_in_one_sentence(launched, tmp_path):
    for argument in ("scene", "device", "parameters"):
        with pytest.raises(FileNotFoundError, match="^nowhere is neither a file nor a name in config.*which has"):
            launched(**{argument: "nowhere"})
    (tmp_path / "own.yaml").write_text("a: [")
    with pytest.raises(ValueError, match=r"^[^\n]*own\.yaml: line 2 is not YAML: [^\n]*$"):
        launched(scene=str(tmp_path / "own.yaml"))


def test_the_launch_file_leaves_the_transitions_to_the_nodes_to_itself_or_to_the_user(launched):
    for who, parameters in (("true", []), ("launch", [{"autostart": False}]), ("false", [{"autostart": False}])):
        nodes = launched(autostart=who)
        assert all(options["parameters"] == parameters for options in nodes.values())
        driven = nodes["haptic_driver"]["driven"]
        assert len(driven) == (2 * len(nodes) if who == "launch" else 0)
        events = [action.options["event"].options["transition_id"] for action in driven if "event" in action.options]
        assert events == [Transition.TRANSITION_CONFIGURE] * (len(driven) // 2)


def test_each_example_gives_the_launch_file_arguments_that_it_has_and_takes(launch_file):
    starts = {"with_own_node": ["haptic"], "two_displays": ["left", "right"]}
    assert {path.name for path in (ROOT / "examples").glob("*.launch.py")} == {f"{name}.launch.py" for name in starts}
    for name, namespaces in starts.items():
        actions = launch_file(f"examples/{name}.launch.py").arguments[0]
        given = [dict(action.options["launch_arguments"]) for action in actions if "launch_arguments" in action.options]
        assert [arguments["namespace"] for arguments in given] == namespaces
        for arguments in given:
            assert len(actions_of(launch_file("launch/haptic_display.launch.py"), arguments)) == 3
