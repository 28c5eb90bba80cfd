# SPDX-License-Identifier: Apache-2.0
"""The launch file and the examples that include it: what they start, with what, and what they refuse."""

import ast
import runpy
import sys
import types
from pathlib import Path

import pytest
import rclpy
import yaml
from lifecycle_msgs.msg import Transition
from rclpy.context import Context
from rclpy.node import Node

from haptic_sim.scene.language import load
from haptic_sim.supervision.system import TOGETHER

ROOT = Path(__file__).resolve().parents[2]
EXECUTABLES = sorted(path.name for path in (ROOT / "scripts").iterdir())


class _Recorded:
    """Stands for a class of the launch packages, which no package index offers: keeps what it was given."""

    def __init__(self, *arguments, **options):
        self.arguments, self.options = arguments, options

    def perform(self, context):
        return context.launch_configurations[self.arguments[0]]

    def evaluate(self, context):
        """Of IfCondition: what it takes for true and for false."""
        return {"true": True, "1": True, "false": False, "0": False}[self.arguments[0].lower()]


def prefix_namespace(base, namespace):
    return namespace if namespace.startswith("/") or not base else f"{base}/{namespace}"


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
    sys.modules["launch_ros.utilities"].prefix_namespace = prefix_namespace
    return lambda path: runpy.run_path(str(ROOT / path))["generate_launch_description"]()


def actions_of(description, given, pushed=None):
    """What a launch description with these arguments comes to, in the namespace that was pushed around it."""
    *declared, opaque = description.arguments[0]
    values = {action.arguments[0]: action.options["default_value"] for action in declared}
    assert given.keys() <= values.keys()
    for action in declared:
        name, choices = action.arguments[0], action.options["choices"]
        assert choices is None or (given.get(name, values[name]) in choices), "launch itself refuses it"
    return opaque.options["function"](_Context(values | given | ({"ros_namespace": pushed} if pushed else {})))


class _Context:
    def __init__(self, launch_configurations):
        self.launch_configurations = launch_configurations


@pytest.fixture
def launched(launch_file):
    """launched(argument=value, ...) gives {executable: options} of the nodes that the launch file would start."""

    def launch(pushed=None, **given):
        actions = actions_of(launch_file("launch/haptic_display.launch.py"), given, pushed)
        driven = [action for action in actions if "executable" not in action.options]
        return {a.options["executable"]: a.options | {"driven": driven} for a in actions if a not in driven}

    return launch


def plain(parameters):
    """The parameters of a node: files, then what the arguments give, texts as such."""
    texts = {"value_type": str}
    return [
        entry
        if isinstance(entry, str)
        else {
            name: value.arguments[0] if isinstance(value, _Recorded) and value.options == texts else value
            for name, value in entry.items()
        }
        for entry in parameters
    ]


@pytest.mark.parametrize("file", [ROOT / "launch/haptic_display.launch.py", *(ROOT / "examples").glob("*.launch.py")])
def test_a_launch_file_runs_in_the_python_of_ros2_which_has_not_our_libraries(file):
    def roots(path):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        found = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        return found | {node.module for node in nodes if isinstance(node, ast.ImportFrom)}

    foreign = {name for name in roots(file) if name.split(".")[0] not in sys.stdlib_module_names}
    ros = {name for name in foreign if name.split(".")[0] in ("launch", "launch_ros", "lifecycle_msgs", "yaml")}
    ours = {
        "haptic_device.config_files",
        "haptic_device.os_errors",
        "haptic_device.yaml_reader",
        "haptic_sim.scene.motion",
    }
    assert foreign - ros <= ours
    for module in ours:
        needed = roots(ROOT / f"{module.replace('.', '/')}.py") - ours
        assert {name.split(".")[0] for name in needed} <= sys.stdlib_module_names | {"yaml"}
    assert roots(ROOT / "haptic_device/__init__.py") == roots(ROOT / "haptic_sim/__init__.py") == set()


def test_the_launch_file_starts_device_driver_and_simulation_in_one_namespace(launched):
    nodes = launched()
    assert set(nodes) == {"haptic_driver", "haptic_simulation", "haptic_loopback"} <= set(EXECUTABLES)
    for options in nodes.values():
        assert (options["package"], options["namespace"], options["parameters"]) == ("haptic_display", "haptic", [])


def test_the_launch_file_takes_namespace_parameter_file_hardware_and_recorder(launched, tmp_path):
    file = tmp_path / "point.yaml"
    file.touch()
    nodes = launched(namespace="left", parameters=str(file), loopback="false", record="true", view="true")
    started = {"haptic_driver", "haptic_simulation", "haptic_recorder", "haptic_viewer"}
    assert set(nodes) == started <= set(EXECUTABLES)
    assert all(options["namespace"] == "left" for options in nodes.values())
    assert all(options["parameters"] == [str(file)] for options in nodes.values())


@pytest.mark.parametrize(("yes", "no"), [("true", "false"), ("True", "False"), ("1", "0")])
def test_the_launch_file_takes_booleans_as_launch_does(launched, yes, no):
    nodes = launched(loopback=no, record=yes, view=yes, rviz=no, enable=yes, autostart=yes)
    assert set(nodes) == {"haptic_driver", "haptic_simulation", "haptic_recorder", "haptic_viewer"}
    assert nodes["haptic_driver"]["parameters"] == [{"auto_enable": True, "auto_enable_wait": TOGETHER}]
    nodes = launched(loopback=yes, record=no, view=no, enable=no, autostart=no)
    assert set(nodes) == {"haptic_driver", "haptic_simulation", "haptic_loopback"}
    assert nodes["haptic_driver"]["parameters"] == [{"autostart": False}] and not nodes["haptic_driver"]["driven"]


def test_launch_itself_refuses_what_no_boolean_may_be_and_says_what_may(launch_file):
    *declared, _ = launch_file("launch/haptic_display.launch.py").arguments[0]
    choices = {action.arguments[0]: action.options["choices"] for action in declared}
    boolean = {name for name, among in choices.items() if among}
    assert boolean == {"enable", "loopback", "record", "view", "rviz", "autostart"}
    spelt = {"true", "True", "1", "false", "False", "0"}
    assert all(set(choices[name]) - {"launch"} == spelt for name in boolean)
    assert [name for name in boolean if "launch" in choices[name]] == ["autostart"]


@pytest.mark.parametrize("scene", ["wall", "maze"])
def test_scene_and_device_of_the_launch_file_reach_the_nodes_after_the_parameter_file(launched, scene):
    """Later files of parameters win; the hand moves as the scene suggests, as in `haptic demo`."""
    nodes = {
        name: plain(options["parameters"])
        for name, options in launched(parameters="demo", scene=scene, device="undamped").items()
    }
    (file,) = {str(values[0]) for values in nodes.values()}
    assert file == str(ROOT / "config/demo.yaml")
    (driver,) = nodes["haptic_driver"][1:]
    (loopback,) = nodes["haptic_loopback"][1:]
    (simulation,) = nodes["haptic_simulation"][1:]
    assert driver == {"device": "undamped"}
    assert simulation == {"scene": str(ROOT / f"config/scenes/{scene}.yaml")}
    motion = {f"motion.{name}": value for name, value in load(ROOT / f"config/scenes/{scene}.yaml").motion.items()}
    assert loopback == {"device": "undamped"} | motion and len(motion) > 2


@pytest.mark.parametrize(
    ("device", "serving"),
    [("desktop", {"haptic_loopback"}), ("moteus_knob", {"haptic_bridge"}), ("own_device", set())],
)
@pytest.mark.parametrize("told", ["argument", "file"])
def test_the_launch_file_starts_what_serves_the_device_that_the_driver_has(launched, tmp_path, device, serving, told):
    (tmp_path / "point.yaml").write_text(f"/**/haptic_driver: {{ros__parameters: {{device: {device}}}}}")
    given = {"device": device} if told == "argument" else {"parameters": str(tmp_path / "point.yaml")}
    nodes = launched(**given)
    assert set(nodes) == {"haptic_driver", "haptic_simulation"} | serving
    for name in serving & {"haptic_bridge"}:
        assert plain(nodes[name]["parameters"])[-1] == {"device": device}


@pytest.mark.parametrize(
    ("text", "motion"),
    [("name: x", {}), ("motion: {name: hold, moving: 'off'}", {"motion.name": "hold", "motion.moving": "off"})],
)
def test_a_scene_of_ones_own_gives_its_motion_as_it_stands(launched, tmp_path, text, motion):
    (tmp_path / "own.yaml").write_text(text)
    nodes = launched(scene=str(tmp_path / "own.yaml"))
    assert plain(nodes["haptic_simulation"]["parameters"]) == [{"scene": str(tmp_path / "own.yaml")}]
    assert plain(nodes["haptic_loopback"]["parameters"]) == ([motion] if motion else [])


def test_a_scene_that_is_no_yaml_is_refused_by_the_launch_file_in_one_sentence(launched, tmp_path):
    (tmp_path / "own.yaml").write_text("a: [")
    with pytest.raises(ValueError, match=r"own\.yaml: line 2 is not YAML: .*") as refused:
        launched(scene=str(tmp_path / "own.yaml"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("argument", ["scene", "device", "parameters"])
def test_a_name_that_is_not_there_is_refused_by_the_launch_file_in_one_sentence(launched, argument):
    with pytest.raises(FileNotFoundError, match="^nowhere is neither a file nor a name in config.*which has"):
        launched(**{argument: "nowhere"})


@pytest.mark.parametrize("key", ["/**", "/**/haptic_driver", "/*/haptic_driver", "/haptic/haptic_driver"])
def test_what_the_launch_file_is_given_wins_over_the_parameter_file(tmp_path, key):
    """launch writes it as a second file, for /haptic/haptic_driver; so rclpy must take the second, however named."""
    files = (("file", key, "servo: {rate: 1.0}"), ("given", "/haptic/haptic_driver", "servo.rate: 2.0"))
    for name, whose, rate in files:
        (tmp_path / name).write_text(f"{whose}:\n  ros__parameters:\n    {rate}\n    {name}: true\n")
    words = [word for name in ("file", "given") for word in ("--params-file", str(tmp_path / name))]
    context = Context()
    rclpy.init(args=["--ros-args", *words], context=context)
    try:
        node = Node(
            "haptic_driver",
            namespace="haptic",
            context=context,
            automatically_declare_parameters_from_overrides=True,
            enable_rosout=False,
        )
        values = {name: node.get_parameter(name).value for name in ("servo.rate", "file", "given")}
        node.destroy_node()
    finally:
        context.shutdown()
    assert values == {"servo.rate": 2.0, "file": True, "given": True}


@pytest.mark.parametrize(
    ("namespace", "pushed", "topics", "frames"),
    [
        ("haptic", None, "/haptic/", "haptic_"),
        ("/a/b/", None, "/a/b/", "a_b_"),
        ("left", "/robot", "/robot/left/", "robot_left_"),
        ("", None, "/", ""),
        ("/", None, "/", ""),
    ],
)
def test_rviz_gets_topics_and_world_of_the_namespace(launched, namespace, pushed, topics, frames):
    nodes = launched(namespace=namespace, pushed=pushed, rviz="true")
    rviz = nodes["rviz2"]
    assert "haptic_viewer" in nodes, "its markers are the viewer's"
    assert rviz["arguments"] == ["-d", str(ROOT / "config/layouts/haptic.rviz"), "-f", f"{frames}map"]
    manager = yaml.safe_load((ROOT / "config/layouts/haptic.rviz").read_text())["Visualization Manager"]
    named = {
        place["Value"]
        for display in manager["Displays"]
        for kind, place in display.items()
        if kind in ("Topic", "Description Topic")
    }
    renamed = dict(rviz["remappings"])
    assert renamed == {topic: topic.replace("/haptic/", topics) for topic in named}


def test_the_launch_file_leaves_the_transitions_to_the_nodes_to_itself_or_to_the_user(launched):
    for who, parameters in (("true", []), ("launch", [{"autostart": False}]), ("false", [{"autostart": False}])):
        nodes = launched(autostart=who)
        assert all(options["parameters"] == parameters for options in nodes.values())
        driven = nodes["haptic_driver"]["driven"]
        assert len(driven) == (2 * len(nodes) if who == "launch" else 0)
    events = [
        action.options["event"].options["transition_id"]
        for action in launched(autostart="launch", view="true")["haptic_driver"]["driven"]
        if "event" in action.options
    ]
    assert events == [Transition.TRANSITION_CONFIGURE] * len(nodes)


def test_the_page_of_installation_has_each_argument_with_its_default(launch_file):
    *declared, _ = launch_file("launch/haptic_display.launch.py").arguments[0]
    section = (ROOT / "docs/how_to/install.md").read_text("utf-8").split("### Launch arguments\n")[1].split("\n### ")[0]
    table = [[cell.strip(" `") for cell in line.split("|")[1:3]] for line in section.splitlines() if line[:3] == "| `"]
    assert table == [[action.arguments[0], action.options["default_value"]] for action in declared]


def included(action):
    """Arguments that an example gives to the launch file of ours that it includes."""
    package, file = action.arguments[0].arguments[0]
    assert package.arguments == ("haptic_display",) and (ROOT / file.strip("/")).is_file()
    return dict(action.options["launch_arguments"])


def test_each_example_gives_the_launch_file_arguments_that_it_has_and_takes(launch_file):
    starts = {"with_own_node": {"haptic"}, "two_displays": {"left", "right"}}
    assert {path.name for path in (ROOT / "examples").glob("*.launch.py")} == {f"{name}.launch.py" for name in starts}
    for name, namespaces in starts.items():
        inside = [a for a in launch_file(f"examples/{name}.launch.py").arguments[0] if "launch_arguments" in a.options]
        given = [included(action) for action in inside]
        assert {arguments["namespace"] for arguments in given} == namespaces
        assert len({frozenset(arguments) for arguments in given}) == 1, "what one is given would stay for the other"
        for arguments in given:
            assert len(actions_of(launch_file("launch/haptic_display.launch.py"), arguments)) == 3


def test_the_node_of_the_example_is_a_file_beside_it_in_the_namespace_of_the_display(launch_file):
    display, own = launch_file("examples/with_own_node.launch.py").arguments[0]
    (file,) = own.options["arguments"]
    assert Path(file) == ROOT / "examples/greatest_force.py" and Path(file).is_file()
    assert own.options["namespace"] == included(display)["namespace"]
