# SPDX-License-Identifier: Apache-2.0
"""The servo's side of a device page for a tool: of a device that runs, or of one that is started for it."""

import contextlib
import os
import secrets
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haptic_device import ros_environment
from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_device.realtime import clock, shared_memory
from haptic_device.realtime.hardware_interface import SAMPLE, SharedMemoryInterface
from haptic_display.run.device_programs import device_programs
from haptic_display.run.domain import isolated_domain
from haptic_display.run.prepare import prepare
from haptic_display.run.processes import NAMESPACE, Nodes
from haptic_sim.scene.needs import served_by

HAND: dict[str, Any] = {}  # as a simulated hand is by default
STARTS = 30.0  # [s] that a node which was started here may take until its device answers
ANSWERS = 3.0  # [s] that one may take which runs already
LOOK = 0.01  # [s]
PERIOD = 1_000_000  # [ns] of the ticks of a PageDevice
LATE = 20_000_000  # [ns] after a deadline that a sample is waited for
SILENT = 1.0  # [s] without a sample of a deadline after which a device is silent
BITS = {
    2: "motors cut by its watchdog",
    4: "emergency stop pressed",
    8: "too hot, motors cut",
    16: "end switch reached",
    32: "encoder broken",
    64: "clock not exact enough",
    128: "motor value clamped",
}
"""Each bit of a sample's status, in words."""
CUTS = 4 | 8 | 32  # bits with which a device takes no motor value


@contextlib.contextmanager
def opened(name: str, domain: int | None, namespace: str | None) -> Iterator[SharedMemoryInterface]:
    """The page of the device that runs there if domain or namespace is given, else of this description's, started here.

    The device answers when this yields. Raises ValueError, OSError where a driver holds the page, NodeDiedError.
    """
    with contextlib.ExitStack() as stack:
        check: Callable[[], dict[str, str]] = dict
        patience, own = ANSWERS, os.environ.get("ROS_DOMAIN_ID")
        if own and name and served_by(load_device(name).link.type) == "":
            domain = ros_environment.domain() if domain is None else domain
        if domain is None and namespace is None:
            logs = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="haptic_")))
            programs = device_programs(str(Path(find("devices", name)).absolute()), HAND, logs)
            if not programs:
                raise ValueError(
                    f"device {name} is served by a program of your own: "
                    "start it, and give its --domain or ROS_DOMAIN_ID"
                )
            domain = stack.enter_context(isolated_domain(logs))
            nodes = stack.enter_context(Nodes(logs))
            prepare(programs)
            for program in programs:
                nodes.start(program)
            check, patience = nodes.check, STARTS
        else:
            domain = ros_environment.domain() if domain is None else domain
            ros_environment.check_namespace(namespace or NAMESPACE)
        interface = SharedMemoryInterface(
            shared_memory.file_name(domain, namespace or NAMESPACE), secrets.randbits(48) | 1
        )
        stack.callback(interface.close)
        _await(interface, check, patience)
        yield interface


def _await(interface: SharedMemoryInterface, check: Callable[[], dict[str, str]], patience: float) -> None:
    end = time.monotonic() + patience
    while not interface.present():
        said = next(iter(check().values()), "")
        if time.monotonic() > end:
            where = f"no device answers on its page within {patience:g} s"
            raise ValueError(f"{where}: {said}" if said else f"{where}; start haptic_bridge or haptic_loopback there")
        time.sleep(LOOK)


class PageDevice:
    """A device on a page, for who asks it slowly: each tick tells it its motor values and returns a sample (8)."""

    def __init__(self, interface: SharedMemoryInterface):
        self._interface, self._scratch = interface, clock.scratch()

    def tick(self, motor: np.ndarray) -> np.ndarray:
        """Motor values (3) [motor units] for 1 ms, and the sample that follows: time, status, counts 3, forces 3.

        Raises ValueError if the device has fallen silent.
        """
        began, sample = time.monotonic(), np.zeros(SAMPLE)
        while time.monotonic() < began + SILENT:
            written = time.monotonic_ns()
            deadline = written + PERIOD
            engaged = int(np.any(motor != 0.0))
            memory = self._interface.memory
            self._interface.write(memory, written, deadline, PERIOD, engaged, motor)
            clock.sleep_until(deadline, self._scratch)
            if self._interface.read(memory, deadline, max(deadline, time.monotonic_ns()) + LATE, sample):
                return sample
        raise ValueError(f"the device has sent no sample for {SILENT:g} s")


def words_of(status: int) -> str:
    """The bits of a sample's status in words."""
    return ", ".join(word for bit, word in BITS.items() if status & bit) or "none"


class Glance(NamedTuple):
    """A device page seen from outside: status, counts (3), drag (3) [N, N m], and the age of the sample [s]."""

    status: int
    counts: tuple[int, ...]
    drag: tuple[float, ...]
    age: float


def glance(name: str, folder: Path | None = None) -> Glance | None:
    """What the device last wrote into the page of this name, without taking part; None where there is no page."""
    try:
        for _ in range(10):
            words = np.fromfile((folder or shared_memory.FOLDER) / name, np.int64)
            lock = int(words[shared_memory.DEVICE_LOCK])
            again = np.fromfile((folder or shared_memory.FOLDER) / name, np.int64)
            if lock and not lock & 1 and again[shared_memory.DEVICE_LOCK] == lock:
                block = words[shared_memory.DEVICE_FIRST :][: shared_memory.DEVICE_WORDS]
                age = (time.monotonic_ns() - int(block[1])) * 1e-9
                return Glance(int(block[2]), tuple(block[4:7].tolist()), tuple(block[7:10].view(float).tolist()), age)
    except (OSError, IndexError):
        return None
    return None
