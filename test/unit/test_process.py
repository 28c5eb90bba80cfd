# SPDX-License-Identifier: Apache-2.0
"""What a process says stands on a line of its own."""

import socket
import subprocess

from live_nodes import MODULES

from haptic_device.process import own_environment, running_module

UNBUFFERED = own_environment() | {"PYTHONUNBUFFERED": "1"}


def test_a_node_s_refusal_is_one_write_with_its_end_so_that_no_line_of_a_log_stands_in_it():
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)  # each write is a message
    with ours, its:
        node = running_module(MODULES["haptic_driver"])
        ended = subprocess.run(node, stderr=its, env=UNBUFFERED | {"ROS_DOMAIN_ID": "abc"}, timeout=100)
        its.close()
        said = [*iter(lambda: ours.recv(65536), b"")]
    assert ended.returncode == 1 and len(said) == 1, said
    assert said[0].startswith(b"haptic_driver: ROS_DOMAIN_ID ") and said[0].endswith(b"\n")
