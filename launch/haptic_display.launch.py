# SPDX-License-Identifier: Apache-2.0
"""Starts the device, the driver and the simulation: `ros2 launch haptic_display haptic_display.launch.py`.

The nodes are lifecycle nodes. `autostart:=true` (default): they configure and activate themselves; `launch`: this file
does it, one transition after the other; `false`: they stay unconfigured for `ros2 lifecycle set /haptic/haptic_driver
configure` and its like.

It runs in the Python of `ros2`, which may not see the libraries of a virtual environment: of ours it takes
`config.files` and `scene.needs` only, which need none but PyYAML.
"""

from functools import partial
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

from haptic_device.config.files import find
from haptic_sim.scene.needs import TOGETHER, needs_of

RVIZ = Path(__file__).parents[1] / "config/layouts/haptic.rviz"
RVIZ_TOPICS = ("markers", "robot_description")  # that it has below /haptic
BOOLEAN = ["true", "True", "1", "false", "False", "0"]  # what IfCondition takes
LAUNCH = "launch"

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
    scene = str(find("scenes", given["scene"]).absolute()) if given["scene"] else ""
    above = context.launch_configurations.get("ros_namespace")
    inside = (prefix_namespace(above, given["namespace"]) or "").strip("/")
    needs = needs_of(scene, given["device"], files, f"/{inside}")
    own = _own(given, on, scene, needs)
    made = partial(_node, namespace=given["namespace"], files=files)
    nodes = [made(LifecycleNode, name, own=own[name]) for name in _executables(on, needs.serving)]
    driven = [action for node in nodes for action in _driven(node)] if given["autostart"] == LAUNCH else []
    page = [made(Node, "haptic_viewer", own={})] if on & {"view", "rviz"} else []
    return nodes + driven + page + ([_rviz(given["namespace"], inside)] if "rviz" in on else [])


def _executables(on, serving):
    optional = {"loopback": serving, "record": "haptic_recorder"}
    wanted = [name for argument, name in optional.items() if name and argument in on]
    return ["haptic_driver", "haptic_simulation", *wanted]


def _own(given, on, scene, needs):
    """{executable: parameters} that the arguments give."""
    own = {} if "autostart" in on else {"autostart": False}
    device = {"device": given["device"]} if given["device"] else {}
    enabling = {"auto_enable": True, "auto_enable_wait": TOGETHER} if "enable" in on else {}
    return {
        "haptic_bridge": own | ({"device": needs.device} if needs.device else {}),
        "haptic_driver": own | device | enabling,
        "haptic_loopback": own | needs.motion | device,
        "haptic_simulation": own | ({"scene": scene} if scene else {}),
        "haptic_recorder": own,
    }


def _node(kind, executable, *, namespace, files, own):
    return kind(
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


def _rviz(namespace, inside):
    """RViz, with topics and world of this namespace in place of those of /haptic."""
    root = f"{inside}/" if inside else ""
    return Node(
        package="rviz2",
        executable="rviz2",
        namespace=namespace,
        arguments=["-d", str(RVIZ), "-f", f"{root.replace('/', '_')}map"],
        remappings=[(f"/haptic/{topic}", f"/{root}{topic}") for topic in RVIZ_TOPICS],
        output="screen",
    )
