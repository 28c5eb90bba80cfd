# SPDX-License-Identifier: Apache-2.0
"""The display with a node of your own beside it: `ros2 launch haptic_display with_own_node.launch.py`."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

NAMESPACE = "haptic"


def generate_launch_description():
    """A scene that presses against a wall, enabled, and greatest_force.py in the same namespace."""
    launch_file = [FindPackageShare("haptic_display"), "/launch/haptic_display.launch.py"]
    arguments = {"namespace": NAMESPACE, "parameters": "demo", "scene": "wall", "enable": "true"}
    display = IncludeLaunchDescription(PythonLaunchDescriptionSource(launch_file), launch_arguments=arguments.items())
    # A node of your own package has package= and executable= instead of the path of a file.
    own = Node(
        executable=sys.executable,
        arguments=[str(Path(__file__).parent / "greatest_force.py")],
        namespace=NAMESPACE,
        output="screen",
    )
    return LaunchDescription([display, own])
