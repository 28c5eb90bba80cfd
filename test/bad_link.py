# SPDX-License-Identifier: Apache-2.0
"""A bad network link between two network namespaces, in user space: no netem in the kernel is needed.

`Link` runs this file as a program of its own namespace, which holds one end of two veth pairs whose other ends lie in
the namespaces `near` and `far`. Frames that come on one are sent on by the other when their time has come: delayed,
lost, doubled, overtaken by others, or not at all while the link is cut. ARP is never lost.
"""

import contextlib
import heapq
import itertools
import json
import random
import select
import socket
import subprocess
import sys
import time

ADDRESSES = {"near": "10.77.0.1/24", "far": "10.77.0.2/24"}
ETH_ALL, ARP, IP, UDP, OUTGOING = 0x0003, b"\x08\x06", b"\x08\x00", 17, 4
PIPES = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}


class Link:
    """The link, as a context. Raises OSError, in a sentence, where no network namespaces can be made."""

    def __init__(self, **network):
        """network: delay and jitter of one way [s], loss, duplicates (shares), cut (bool)."""
        self._network = network

    def __enter__(self):
        command = ["unshare", "-rn", sys.executable, __file__]
        self._process = subprocess.Popen(command, stderr=subprocess.PIPE, **PIPES)
        said = self._process.stdout.readline()
        if not said:
            reason = self._process.communicate()[1].strip().splitlines()
            raise OSError(f"no network namespaces can be made here; {(reason or ['?'])[-1]}")
        self._pids = json.loads(said)
        self.set(**self._network)
        return self

    def __exit__(self, *exception):
        self._process.kill()  # who holds a namespace reads from it, and ends
        self._process.communicate()

    def set(self, **network):
        """Changes what the link does from now on."""
        self._process.stdin.write(json.dumps(network) + "\n")
        self._process.stdin.flush()

    def inside(self, where, command):
        """Command line that runs a command in the namespace `near` or `far`."""
        return ["nsenter", "-t", str(self._pids[where]), "-n", "-U", "--preserve-credentials", *command]


class Way:
    """Frames from one socket to another."""

    def __init__(self, source, target, seed):
        self.source, self._target, self._random = source, target, random.Random(seed)
        self._number, self._flying = itertools.count(), []

    due = property(lambda self: self._flying[0][0] if self._flying else float("inf"))

    def carry(self, network, now):
        """Takes what has come, sends what is due."""
        with contextlib.suppress(BlockingIOError):
            while True:
                frame, address = self.source.recvfrom(65536)
                if address[2] != OUTGOING and not network["cut"]:
                    self._take(bytearray(frame), network, now)
        while self.due <= now:
            with contextlib.suppress(OSError):  # a full queue loses a frame, as networks do
                self._target.send(heapq.heappop(self._flying)[2])

    def _take(self, frame, network, now):
        if frame[12:14] != ARP and self._random.random() < network["loss"]:
            return
        if frame[12:14] == IP and frame[23] == UDP and not (frame[20] & 0x1F or frame[21]):
            udp = 14 + 4 * (frame[14] & 0xF)
            frame[udp + 6 : udp + 8] = bytes(2)  # no checksum: a veth leaves it to a hardware that is not there
        for _ in range(1 + (self._random.random() < network["duplicates"])):
            flight = network["delay"] + network["jitter"] * (2.0 * self._random.random() - 1.0)
            heapq.heappush(self._flying, (now + max(0.0, flight), next(self._number), frame))


def connected(name):
    """Who holds a namespace of its own; a raw socket on this end of a veth pair whose other end is in there."""
    holder = subprocess.Popen(["unshare", "-n", "sh", "-c", "echo; exec cat"], **PIPES)
    holder.stdout.readline()
    within = f"nsenter -t {holder.pid} -n ip"
    for command in (
        f"ip link add {name} type veth peer name end netns {holder.pid}",
        f"{within} addr add {ADDRESSES[name]} dev end",
        f"{within} link set lo up",
        f"{within} link set end up",
        f"{within} route add 224.0.0.0/4 dev end",
        f"ip link set {name} promisc on up",
    ):
        subprocess.run(command.split(), check=True)
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_ALL))
    end.bind((name, 0))
    end.setblocking(False)
    return holder, end


def emulate():
    """Carries frames; each line of standard input is a JSON object of what changes."""
    holders, ends = zip(*map(connected, ADDRESSES), strict=True)
    print(json.dumps({name: holder.pid for name, holder in zip(ADDRESSES, holders, strict=True)}), flush=True)
    ways = Way(*ends, 1), Way(*ends[::-1], 2)
    network = {"delay": 0.0, "jitter": 0.0, "loss": 0.0, "duplicates": 0.0, "cut": False}
    while True:
        timeout = min(0.05, max(0.0, min(way.due for way in ways) - time.monotonic()))
        if sys.stdin in select.select([sys.stdin, *ends], [], [], timeout)[0]:
            network |= json.loads(sys.stdin.readline())
        for way in ways:
            way.carry(network, time.monotonic())


if __name__ == "__main__":
    emulate()
