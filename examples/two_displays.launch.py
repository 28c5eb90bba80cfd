# SPDX-License-Identifier: Apache-2.0
"""Two displays, one for each hand: `ros2 launch haptic_display two_displays.launch.py`.

Nodes, topics, frames and the memory shared with the device carry the namespace, /left or /right.
"""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.substitutions import FindPackageShare

SCENES = {"left": "wall", "right": "free_space"}


def generate_launch_description():
    """A display for each namespace. What one of them is given the other must be given too: arguments of launch stay."""
    return LaunchDescription([_display(namespace, scene) for namespace, scene in SCENES.items()])


def _display(namespace, scene):
    launch_file = [FindPackageShare("haptic_display"), "/launch/haptic_display.launch.py"]
    arguments = {"namespace": namespace, "parameters": "demo", "scene": scene, "enable": "true"}
    return IncludeLaunchDescription(PythonLaunchDescriptionSource(launch_file), launch_arguments=arguments.items())
