# SPDX-License-Identifier: Apache-2.0
"""A bad network link between two network namespaces, in user space: no netem in the kernel is needed.

`Link` runs this file as a program of its own namespace, which holds one end of two veth pairs whose other ends lie in
the namespaces `near` and `far`. Frames that come on one are sent on by the other when their time has come: delayed,
lost, doubled, overtaken by others, or not at all while the link is cut. ARP is never lost.
"""

import contextlib
import ctypes
import fcntl
import heapq
import itertools
import json
import os
import random
import select
import socket
import struct
import subprocess
import sys
import time

ADDRESSES = {"near": "10.77.0.1/24", "far": "10.77.0.2/24"}
WAYS_IN = (["unshare", "-n"], ["unshare", "-rn"])  # as root, else with a user namespace
END = "end0"  # of the pair, within its namespace
ETH_ALL, ARP, OUTGOING = 0x0003, b"\x08\x06", 4
CLONE_NEWNET = 0x40000000
SIOCETHTOOL, SET_TX_CHECKSUM = 0x8946, 0x17


class NoNamespacesError(OSError):
    """No network namespaces, or no veth pairs, can be made here; says why in one sentence."""


class Link:
    """The link, as a context: ends with everything that was started in its namespaces. Raises NoNamespacesError."""

    def __init__(self, **network):
        """network: delay and jitter of one way [s], loss, duplicates (shares), cut (bool)."""
        self._network, self.pids = network, {}

    def __enter__(self):
        reasons = []
        for way in WAYS_IN:
            command = [*way, sys.executable, __file__, "emulate"]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            said = self._process.stdout.readline()
            if said:
                self.pids, self._user = json.loads(said), "-r" in way[-1]
                self.set(**self._network)
                return self
            reasons.append(f"{' '.join(way)}: {(self._process.communicate()[1].strip().splitlines() or ['?'])[-1]}")
        raise NoNamespacesError("no network namespaces can be made here; " + "; ".join(reasons))

    def __exit__(self, *exception):
        self._process.stdin.close()
        try:
            self._process.wait(20.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(20.0)
        self._process.stdout.close()
        self._process.stderr.close()

    def set(self, **network):
        """Changes what the link does from now on."""
        self._process.stdin.write(json.dumps(network) + "\n")
        self._process.stdin.flush()

    def inside(self, where, command):
        """Command line that runs a command in the namespace `near` or `far`."""
        user = ["-U", "--preserve-credentials"] if self._user else []
        return ["nsenter", "-t", str(self.pids[where]), "-n", *user, *command]


class Way:
    """Frames from one socket to another."""

    def __init__(self, source, target, seed):
        self.source, self._target, self._random = source, target, random.Random(seed)
        self._number, self._flying = itertools.count(), []

    @property
    def due(self):
        return self._flying[0][0] if self._flying else float("inf")

    def carry(self, network, now):
        """Takes what has come, sends what is due."""
        with contextlib.suppress(BlockingIOError):
            while True:
                frame, address = self.source.recvfrom(65536)
                if address[2] != OUTGOING and not network["cut"]:
                    self._take(frame, network, now)
        while self.due <= now:
            with contextlib.suppress(OSError):  # a full queue loses a frame, as networks do
                self._target.send(heapq.heappop(self._flying)[2])

    def _take(self, frame, network, now):
        if frame[12:14] != ARP and self._random.random() < network["loss"]:
            return
        for _ in range(1 + (self._random.random() < network["duplicates"])):
            flight = network["delay"] + network["jitter"] * (2.0 * self._random.random() - 1.0)
            heapq.heappush(self._flying, (now + max(0.0, flight), next(self._number), frame))


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f"{' '.join(command)}: {done.stderr.strip() or done.stdout.strip()}")


def hold():
    """In a network namespace of its own until standard input ends, as it does when who started it ends."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET) != 0:
        raise OSError(f"unshare(CLONE_NEWNET) was refused: {os.strerror(ctypes.get_errno())}")
    print("held", flush=True)
    sys.stdin.read()


def hold_namespace():
    """A process that does nothing in a network namespace of its own."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    holder = subprocess.Popen([sys.executable, __file__, "hold"], text=True, **pipes)
    if not holder.stdout.readline():
        raise OSError(holder.communicate(timeout=20.0)[1].strip())
    return holder


def connect(name, pid):
    """A veth pair between this namespace and that of the process; a raw socket on this end."""
    run("ip", "link", "add", name, "type", "veth", "peer", "name", END, "netns", str(pid))
    within = ("nsenter", "-t", str(pid), "-n")
    run(*within, "ip", "addr", "add", ADDRESSES[name], "dev", END)
    run(*within, "ip", "link", "set", "lo", "up")
    run(*within, "ip", "link", "set", END, "up")
    run(*within, "ip", "route", "add", "224.0.0.0/4", "dev", END)
    run(*within, sys.executable, __file__, "checksums", END)
    run("ip", "link", "set", name, "promisc", "on", "up")
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_ALL))
    end.bind((name, 0))
    end.setblocking(False)
    return end


def write_checksums(name):
    """Has the kernel write checksums into frames, which on a veth it leaves to a hardware that is not there."""
    value = ctypes.create_string_buffer(struct.pack("II", SET_TX_CHECKSUM, 0))
    request = struct.pack("16sP", name.encode(), ctypes.addressof(value))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SIOCETHTOOL, request)


def emulate():
    """Until standard input ends; each line there is a JSON object of what changes."""
    with contextlib.ExitStack() as stack:
        pids = {}
        for name in ADDRESSES:
            holder = stack.enter_context(hold_namespace())  # its standard input is closed at the end, and it waited for
            pids[name] = holder.pid
        near, far = (connect(name, pid) for name, pid in pids.items())
        print(json.dumps(pids), flush=True)
        carry_on(near, far)


def carry_on(near, far):
    """Carries frames between the two ends until standard input ends."""
    ways = Way(near, far, 1), Way(far, near, 2)
    network = {"delay": 0.0, "jitter": 0.0, "loss": 0.0, "duplicates": 0.0, "cut": False}
    while True:
        timeout = min(0.05, max(0.0, min(way.due for way in ways) - time.monotonic()))
        ready, _, _ = select.select([sys.stdin, near, far], [], [], timeout)
        if sys.stdin in ready:
            line = sys.stdin.readline()
            if not line:
                return
            network |= json.loads(line)
        for way in ways:
            way.carry(network, time.monotonic())


if __name__ == "__main__":
    try:
        {"checksums": write_checksums, "hold": hold, "emulate": emulate}[sys.argv[1]](*sys.argv[2:])
    except OSError as refusal:
        sys.exit(f"bad_link: {refusal}")
