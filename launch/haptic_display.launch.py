# SPDX-License-Identifier: Apache-2.0
"""Starts the loopback device, the driver and the simulation: `ros2 launch haptic_display haptic_display.launch.py`.

The nodes are lifecycle nodes that configure and activate themselves (parameter autostart).
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

ARGUMENTS = {
    "namespace": ("haptic", "namespace of all nodes and topics"),
    "parameters": ("", "parameter file (YAML) for all nodes; empty: every parameter at its default"),
    "loopback": ("true", "start the loopback device; false when hardware is attached"),
    "record": ("false", "start the recorder too"),
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
    return [_node(executable, given) for executable in executables]


def _node(executable, given):
    return LifecycleNode(
        package="haptic_display",
        executable=executable,
        name=executable,
        namespace=given["namespace"],
        parameters=[given["parameters"]] if given["parameters"] else [],
        output="screen",
    )
