# SPDX-License-Identifier: Apache-2.0
"""How a process joins ROS: what keeps it from that is a ValueError of one sentence."""

import re
import sys

import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from haptic_device import ros_environment
from haptic_device.parameter_files import reaches, section_keys

KINDS = "haptic_driver", "haptic_loopback", "haptic_simulation", "haptic_recorder", "haptic_relay", "haptic_viewer"


def begin_ros(args, **where):
    """rclpy.init without signal handlers; ValueError, one sentence, for arguments, a file or variables of the
    environment that ROS cannot take. where: context and domain_id, as of rclpy.init."""
    ros_environment.check()
    try:
        left = remove_ros_args(args=sys.argv if args is None else args)[1 if args is None else 0 :]
        if left:
            raise ValueError(f"{left[0]} is no argument of a node; ROS arguments begin with --ros-args")
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO, **where)
    except RuntimeError as error:  # rcl's own kinds are nowhere public; their text ends with places in its source
        raise ValueError(f"ROS does not take these arguments: {_plain(error)}") from None


def made(make_node):
    """The node; ValueError, one sentence, where ROS makes none (a middleware without security is asked for it)."""
    try:
        return make_node()
    except RuntimeError as error:
        raise ValueError(f"ROS makes no node: {_plain(error)}") from None


def refuse_files_of_others(node, kind: str, args) -> None:
    """Raises ValueError, one sentence, for a parameter file that was meant for this kind of node and misses this one.

    ROS reads it and keeps to the defaults, which may allow more force than the file. One that names other kinds of
    nodes alone may be given to all.
    """
    name, words = node.get_fully_qualified_name(), sys.argv if args is None else args
    for file in [file for word, file in zip(words, words[1:], strict=False) if word == "--params-file"]:
        keys = section_keys(file)
        named = {key.rpartition("/")[2] for key in keys}
        if not (named <= {*KINDS} - {kind} or any(reaches(key, name) for key in keys)):
            raise ValueError(f"{file} has nothing for {name}, it is for {', '.join(keys)}")


def _plain(error):
    """The text of one of rcl's errors without the places in its source."""
    heads = "failed to initialize rcl|Failed to parse ROS arguments|error creating node"
    return " ".join(re.sub(rf",? at \S+:\d+|^({heads}): ", "", str(error)).split())
