# SPDX-License-Identifier: Apache-2.0
"""What a process says stands on a line of its own."""

import socket
import subprocess

from live_nodes import MODULES

from haptic_device.process import own_environment, running_module


def test_a_node_s_refusal_is_one_write_with_its_newline_so_that_no_log_stands_in_it():
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)  # each write is a message
    with ours, its:
        environment = own_environment() | {"PYTHONUNBUFFERED": "1", "ROS_DOMAIN_ID": "abc"}
        node = running_module(MODULES["haptic_driver"])
        ended = subprocess.run(node, stderr=its, env=environment, timeout=100)
        its.close()
        said = [*iter(lambda: ours.recv(65536), b"")]
    assert ended.returncode == 1 and len(said) == 1, said
    assert said[0].startswith(b"haptic_driver: ROS_DOMAIN_ID ") and said[0].endswith(b"\n")


def test_a_command_whose_standard_error_is_closed_does_what_it_is_to_do():
    command = [*running_module("haptic_display.cli.main"), "scenes"]
    closed = ["sh", "-c", 'exec "$@" 2>&-', "sh", *command]
    ended = subprocess.run(closed, env=own_environment(), capture_output=True, text=True, timeout=100)
    assert ended.returncode == 0 and "peg_in_hole" in ended.stdout
