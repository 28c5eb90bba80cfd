# SPDX-License-Identifier: Apache-2.0
"""Starts the loopback device, the driver and the simulation: `ros2 launch haptic_display haptic_display.launch.py`.

The nodes are lifecycle nodes. `autostart:=true` (default): they configure and activate themselves; `launch`: this file
does it, one transition after the other; `false`: they stay unconfigured for `ros2 lifecycle set /haptic/haptic_driver
configure` and its like.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition

ARGUMENTS = {
    "namespace": ("haptic", "namespace of all nodes and topics"),
    "parameters": ("", "parameter file (YAML) for all nodes; empty: every parameter at its default"),
    "loopback": ("true", "start the loopback device; false when hardware is attached"),
    "record": ("false", "start the recorder too"),
    "autostart": ("true", "who configures and activates the nodes: true (they themselves), launch, or false (you)"),
}


def generate_launch_description():
    """The arguments above, then the nodes they ask for."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])


def _nodes(context):
    # Only here the arguments are plain text: ROS refuses an empty parameter file name, so it must be left out.
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    executables = ["haptic_driver", "haptic_simulation"]
    executables += ["haptic_loopback"] if given["loopback"] == "true" else []
    executables += ["haptic_recorder"] if given["record"] == "true" else []
    nodes = [_node(executable, given) for executable in executables]
    return nodes + ([action for node in nodes for action in _driven(node)] if given["autostart"] == "launch" else [])


def _driven(node):
    """Configures the node once it is there, and activates it once it is inactive."""
    activate = _change(node, Transition.TRANSITION_ACTIVATE)
    configured = OnStateTransition(
        target_lifecycle_node=node, start_state="configuring", goal_state="inactive", entities=[activate]
    )
    return [RegisterEventHandler(configured), _change(node, Transition.TRANSITION_CONFIGURE)]


def _change(node, transition):
    return EmitEvent(event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition))


def _node(executable, given):
    return LifecycleNode(
        package="haptic_display",
        executable=executable,
        name=executable,
        namespace=given["namespace"],
        parameters=_parameters(given),
        output="screen",
    )


def _parameters(given):
    """The file, if there is one; and what the argument autostart says against it."""
    file = [given["parameters"]] if given["parameters"] else []
    return file if given["autostart"] == "true" else [*file, {"autostart": False}]
