# SPDX-License-Identifier: Apache-2.0
"""The running demo in the hands of chaos: a hand that presses a wall, and nodes that are taken away."""

import contextlib
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fault_injection.listener import Listener
from haptic_device.realtime import shared_memory
from haptic_display.run.prepare import prepare
from haptic_display.run.processes import NAMESPACE, NodeDiedError, Nodes, Program

NODES = ("haptic_driver", "haptic_loopback", "haptic_simulation")
FREE, PRESSED = 0.03, -0.003  # [m] where the hand is in free space; and where it wants to be in the wall
FORCE = 4.5  # [N] from which the wall is pressed
PATIENCE = 240.0  # [s] for anything, on a machine that does much else
SETTLED = 0.15  # [s] until a handle that has arrived stands still
HELD = 0.4  # [s] that the wall is pressed before anything happens
AGAIN = 0.2  # [s] between two attempts to enable
LOOK = 0.002  # s


class FaultInjector:
    """Starts the programs and holds them; as a context it leaves nothing behind."""

    def __init__(self, programs: list[Program], folder: Path, domain: int):
        prepare(programs)  # before the listener has a thread that somebody must end
        self.programs = {program.name: program for program in programs}
        self.nodes, self.listener = Nodes(folder / "log"), Listener(domain)
        self.folder, self._bags = folder, 0
        self._page = shared_memory.FOLDER / shared_memory.file_name(str(domain), NAMESPACE)

    def __enter__(self):
        for program in self.programs.values():
            self.nodes.start(program)
        return self

    def __exit__(self, *exception):
        self.nodes.stop()
        self.listener.close()

    def begin(self, limit: float = PATIENCE) -> None:
        """Everything well: engaged, no fault, the hand in free space; forgets what was heard."""
        self.listener.aim(FREE)
        self.enable(limit)
        self.until(self.still, limit, "the handle at rest")
        self.wait(SETTLED)
        self.listener.begin()

    def press(self) -> None:
        """Has the hand press the wall, and hold on until that was heard of; begins again after a fault."""

        def pressed():
            if self.faulty:
                self.release()
                self.enable()
                self.listener.aim(PRESSED)
            return self.force > FORCE

        self.listener.aim(PRESSED)
        self.until(pressed, PATIENCE, f"{FORCE} N at the wall")
        self.wait(HELD)

    def release(self) -> None:
        """Has the hand go back to free space."""
        self.listener.aim(FREE)

    def kill(self, name: str) -> None:
        """kill -9."""
        self._signal(name, signal.SIGKILL)
        self.nodes.end(name)

    def freeze(self, name: str) -> None:
        """SIGSTOP."""
        self._signal(name, signal.SIGSTOP)

    def thaw(self, name: str) -> None:
        """SIGCONT."""
        self._signal(name, signal.SIGCONT)

    def _signal(self, name, number):
        os.kill(self.nodes.pid(name), number)

    def start(self, name: str) -> None:
        """Starts a node again; the recorder with a new bag."""
        program = self.programs[name]
        if name == "haptic_recorder":
            self._bags += 1
            program = program._replace(parameters={**program.parameters, "bag": str(self.folder / f"bag-{self._bags}")})
        self.listener.statuses.pop(name, None)
        self.nodes.start(program)

    def enable(self, limit: float = PATIENCE) -> float:
        """Resets and enables until the display is engaged with a fresh tool sample; seconds that took."""
        began, asked = time.monotonic(), 0.0
        while not self.engaged:
            if time.monotonic() - began > limit:
                raise NodeDiedError(f"the display was not engaged within {limit:g} s; driver: {self.driver_says()}")
            if time.monotonic() - asked > AGAIN:
                asked = time.monotonic()
                self._clear()
            time.sleep(LOOK)
        return time.monotonic() - began

    def _clear(self):
        row = self.listener.row
        if row is None or not self.fresh:
            return
        if row["fault"]:
            self.listener.call("reset", AGAIN)
        elif row["state"] == 0.0:
            self.listener.call("enable", AGAIN)

    @property
    def fresh(self) -> bool:
        """Whether the driver's ticks are coming now."""
        row = self.listener.row
        return row is not None and time.monotonic() - row["deadline"] * 1e-9 < 0.1

    @property
    def engaged(self) -> bool:
        """Engaged, with a tool sample in full use, on a device that is told of now."""
        row, truth = self.listener.row, self.listener.truth
        told = truth is not None and time.monotonic() - truth[0] < 0.1
        return self.fresh and told and row["state"] == 3.0 and row["exchange_fade"] >= 1.0

    @property
    def faulty(self) -> bool:
        """Whether a fault is latched: one that needs a hand that lets go before it can be enabled again."""
        row = self.listener.row
        return row is not None and row["fault"] != 0.0

    @property
    def force(self) -> float:
        """Of the motor on the handle [N], newest truth."""
        truth = self.listener.truth
        return float(np.hypot(*truth[4][:2])) if truth else 0.0

    def still(self) -> bool:
        """Whether the handle is where the hand wants it in free space."""
        truth = self.listener.truth
        return truth is not None and abs(truth[1] - FREE) < 1e-3 and abs(truth[2]) < 1e-3

    def heartbeat(self) -> float:
        """CLOCK_MONOTONIC [s] of the servo's last write into the page."""
        block = np.zeros(shared_memory.SERVO_WORDS, np.int64)
        shared_memory.read_servo(np.fromfile(self._page, np.int64), block)
        return float(block[1] * 1e-9)

    def until(self, condition: Callable[[], bool], limit: float, what: str) -> float:
        """Waits for a condition; seconds that took. Raises NodeDiedError."""
        began = time.monotonic()
        while not condition():
            if time.monotonic() - began > limit:
                raise NodeDiedError(f"{what} did not come within {limit:g} s; driver: {self.driver_says()}")
            time.sleep(LOOK)
        return time.monotonic() - began

    def wait(self, seconds: float) -> None:
        """Lets things happen."""
        time.sleep(seconds)

    def driver_says(self) -> str:
        """The driver's last status, or that there is none."""
        said = self.listener.statuses.get("haptic_driver")
        return said.message if said else "nothing was heard"

    def tracebacks(self) -> int:
        """How many tracebacks the nodes have printed so far."""
        logs = (self.folder / "log").glob("haptic_*.log")
        return sum(log.read_text(errors="replace").count("Traceback (most") for log in logs)

    def left_over(self) -> list[str]:
        """What is there though all nodes have ended: the page."""
        with contextlib.suppress(FileNotFoundError):
            os.stat(self._page)
            return [str(self._page)]
        return []
