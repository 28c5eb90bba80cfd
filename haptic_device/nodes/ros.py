# SPDX-License-Identifier: Apache-2.0
"""How a process joins ROS: what keeps it from that is a ValueError of one sentence."""

import re
import sys
from itertools import pairwise

import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from haptic_device import ros_environment
from haptic_device.config import yaml_reader
from haptic_device.config.parameter_sections import reaches, sections

_NODES = "bridge", "driver", "loopback", "simulation", "recorder", "relay", "viewer"
KINDS = tuple(f"haptic_{node}" for node in _NODES)
FILE = "params file"
REMEDY = {
    "parameter override rule": "write -p NAME:=VALUE, the value as in YAML: 1.0, true, text or [1.0, 2.0]",
    "remap rule": "write -r FROM:=TO",
    FILE: "",
}
"""What rcl's parser of arguments refuses, as it calls it, and what to write."""
JARGON = ("Expected lexeme", "Expecting token", "Error parsing an event")  # reasons that tell nothing


def begin_ros(args, **where):
    """rclpy.init without signal handlers; ValueError, one sentence, for arguments, a file or variables of the
    environment that ROS cannot take. where: context and domain_id, as of rclpy.init."""
    ros_environment.check()
    given = sys.argv if args is None else args
    for file in _parameter_files(given):
        yaml_reader.load(file, ros=True)  # ROS itself takes a key twice, and does not say what it cannot read
    try:
        left = remove_ros_args(args=given)[1 if args is None else 0 :]
        if left:
            raise ValueError(f"{left[0]} is no argument of a node; ROS arguments begin with --ros-args")
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO, **where)
    except RuntimeError as error:  # rcl's own kinds are nowhere public; their text ends with places in its source
        raise ValueError(f"ROS does not take these arguments: {_argument_refused(_plain(error))}") from None


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
    name = node.get_fully_qualified_name()
    for file in _parameter_files(sys.argv if args is None else args):
        keys = [key for key, _ in sections(yaml_reader.load(file, ros=True))]
        named = {key.rpartition("/")[2] for key in keys}
        if not (named <= {*KINDS} - {kind} or any(reaches(key, name) for key in keys)):
            raise ValueError(f"{file} has nothing for {name}, it is for {', '.join(keys)}")


def _parameter_files(words):
    return [file for before, file in pairwise(words) if before == "--params-file"]


def _argument_refused(said):
    """What rcl's parser says, in words about the argument."""
    match = re.fullmatch(rf"Couldn't parse ({'|'.join(REMEDY)}): '(.*?)'(?:\. Error: (.*))?", said)
    if not match:
        return said
    rule, argument, why = match.groups()
    if rule == FILE:
        return f"{argument.removeprefix('--params-file ')}: {why}"
    told = "" if why is None or why.startswith(JARGON) else f"{why}; "
    return f"{argument}: {told}{REMEDY[rule]}"


def _plain(error):
    """The text of one of rcl's errors without the places in its source."""
    heads = "failed to initialize rcl|Failed to parse ROS arguments|error creating node"
    return " ".join(re.sub(rf",? at \S+:\d+|^({heads}): ", "", str(error)).split())
