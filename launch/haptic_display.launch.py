# SPDX-License-Identifier: Apache-2.0
"""Starts the device, the driver and the simulation: `ros2 launch haptic_display haptic_display.launch.py`.

The nodes are lifecycle nodes. `autostart:=true` (default): they configure and activate themselves; `launch`: this file
does it, one transition after the other; `false`: they stay unconfigured for `ros2 lifecycle set /haptic/haptic_driver
configure` and its like.

It runs in the Python of `ros2`, which may not see the libraries of a virtual environment: of ours it takes
`config_files`, `yaml_reader` and `motion` only, which need none but PyYAML.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.conditions import IfCondition
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.utilities import prefix_namespace
from lifecycle_msgs.msg import Transition

from haptic_device.config.files import find, find_beside
from haptic_device.config.yaml_reader import load
from haptic_sim.scene.motion import flat_motion

RVIZ = Path(__file__).parents[1] / "config/layouts/haptic.rviz"
RVIZ_TOPICS = ("markers", "robot_description")  # that it has below /haptic
BOOLEAN = ["true", "True", "1", "false", "False", "0"]  # what IfCondition takes
LAUNCH = "launch"
TOGETHER = 45.0  # [s] that a driver which enables itself waits for the tool, as in `haptic demo`

# name: (default, meaning, choices; None: any text)
ARGUMENTS = {
    "namespace": ("haptic", "namespace of all nodes and topics", None),
    "parameters": ("", "parameter file of all nodes, or a name in config; empty: every parameter at its default", None),
    "scene": ("", "scene, a file or a name; the simulated hand moves as it suggests; empty: as parameters say", None),
    "device": ("", "device of driver and loopback, a file or a name; empty: as parameters say", None),
    "enable": ("false", "the driver enables itself once the tool answers; false: as parameters say", BOOLEAN),
    "loopback": ("true", "start what serves the device: haptic_loopback, or haptic_bridge if it has a link", BOOLEAN),
    "record": ("false", "start the recorder too", BOOLEAN),
    "view": ("false", "start haptic_viewer too, whose page it prints the address of", BOOLEAN),
    "rviz": ("false", "start rviz2 on this namespace, and haptic_viewer for its markers", BOOLEAN),
    "autostart": ("true", "who configures and activates: true (the nodes), launch, or false (you)", [*BOOLEAN, LAUNCH]),
}


def generate_launch_description():
    """The arguments above, then the nodes they ask for."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning, choices=choices)
        for name, (default, meaning, choices) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])


def _nodes(context):
    # Only here the arguments are plain text: ROS refuses an empty parameter file name, so it must be left out.
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    choices = {name: given[name] for name, (*_, chosen) in ARGUMENTS.items() if chosen and given[name] != LAUNCH}
    on = {name for name, value in choices.items() if IfCondition(value).evaluate(context)}
    files = [str(find("", given["parameters"]))] if given["parameters"] else []
    own = _own(given, on)
    device = given["device"] or _device_in(files)
    serving = _serving(device)
    own["haptic_bridge"] |= {"device": device} if device else {}
    nodes = [_managed(name, given["namespace"], files, own.get(name, {})) for name in _executables(on, serving)]
    driven = [action for node in nodes for action in _driven(node)] if given["autostart"] == LAUNCH else []
    page = [_page(given["namespace"], files)] if on & {"view", "rviz"} else []
    return nodes + driven + page + ([_rviz(context, given["namespace"])] if "rviz" in on else [])


def _serving(device):
    """The node that serves the device of the argument, by its description's link; none, if it is another's process."""
    link = (load(find("devices", device)).get("link") if device else None) or {"type": "loopback"}
    kind = link.get("type") if isinstance(link, dict) else None  # what is wrong in it, the driver says
    return {"loopback": "haptic_loopback", "shared_memory": None}.get(kind, "haptic_bridge")


def _device_in(files):
    """The device that a parameter file gives the driver, as a path or name; "" for none."""
    found = ""
    for file in files:
        try:
            sections = load(file, ros=True)
        except ValueError:  # which the nodes say
            continue
        for key, section in sections.items():
            own = key.rpartition("/")[2] in ("haptic_driver", "**") and isinstance(section, dict)
            values = section.get("ros__parameters") if own else None
            if isinstance(values, dict) and isinstance(values.get("device"), str):
                found = find_beside(Path(file), "devices", values["device"])
    return found


def _executables(on, serving):
    optional = {"loopback": serving, "record": "haptic_recorder"} if serving else {"record": "haptic_recorder"}
    return ["haptic_driver", "haptic_simulation", *(name for argument, name in optional.items() if argument in on)]


def _own(given, on):
    """{executable: parameters} that the arguments give. Raises OSError and ValueError, one sentence."""
    driver, bridge, loopback, simulation, recorder = (
        {} if "autostart" in on else {"autostart": False} for _ in range(5)
    )
    if given["scene"]:
        scene = find("scenes", given["scene"]).absolute()
        simulation["scene"] = str(scene)
        loopback |= {f"motion.{name}": value for name, value in _motion(scene).items()}
    if given["device"]:
        find("devices", given["device"])
        driver["device"] = loopback["device"] = given["device"]
    if "enable" in on:
        driver |= {"auto_enable": True, "auto_enable_wait": TOGETHER}
    return {
        "haptic_bridge": bridge,
        "haptic_driver": driver,
        "haptic_loopback": loopback,
        "haptic_simulation": simulation,
        "haptic_recorder": recorder,
    }


def _motion(scene):
    """The motion of the hand that a scene suggests; what is wrong in the rest of it, the simulation says."""
    motion = load(scene).get("motion")
    try:
        return flat_motion(motion) if isinstance(motion, dict) else {}
    except ValueError as error:
        raise ValueError(f"{scene}: motion.{error}") from None


def _managed(executable, namespace, files, own):
    return LifecycleNode(
        package="haptic_display",
        executable=executable,
        name=executable,
        namespace=namespace,
        parameters=[*files, {name: _text(value) for name, value in own.items()}] if own else files,
        output="screen",
    )


def _text(value):
    """A text that stays one: launch reads a plain text as YAML, in which `off` is a boolean."""
    return ParameterValue(value, value_type=str) if isinstance(value, str) else value


def _driven(node):
    """Configures the node once it is there, and activates it once it is inactive."""
    activate = _change(node, Transition.TRANSITION_ACTIVATE)
    configured = OnStateTransition(
        target_lifecycle_node=node, start_state="configuring", goal_state="inactive", entities=[activate]
    )
    return [RegisterEventHandler(configured), _change(node, Transition.TRANSITION_CONFIGURE)]


def _change(node, transition):
    return EmitEvent(event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition))


def _page(namespace, files):
    return Node(
        package="haptic_display",
        executable="haptic_viewer",
        name="haptic_viewer",
        namespace=namespace,
        parameters=files,
        output="screen",
    )


def _rviz(context, namespace):
    """RViz, with topics and world of this namespace in place of those of /haptic."""
    inside = prefix_namespace(context.launch_configurations.get("ros_namespace"), namespace).strip("/")
    root = f"{inside}/" if inside else ""
    return Node(
        package="rviz2",
        executable="rviz2",
        namespace=namespace,
        arguments=["-d", str(RVIZ), "-f", f"{root.replace('/', '_')}map"],
        remappings=[(f"/haptic/{topic}", f"/{root}{topic}") for topic in RVIZ_TOPICS],
        output="screen",
    )
