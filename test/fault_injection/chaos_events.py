# SPDX-License-Identifier: Apache-2.0
"""The events of chaos: each takes the running demo, does something to it, and says what came of it."""

import itertools
import math
import os
import random
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

from fault_injection import chaos_figures as figures
from fault_injection.fault_injector import NODES, PATIENCE, FaultInjector
from fault_injection.flood import COMMAND, SENT
from haptic_device.control import enable_state
from haptic_device.process import ending_with_us, own_environment
from haptic_device.recording.status import LEVELS, number

GONE = 0.4  # [s] that a node is away
HEARD = 0.2  # [s] until everything that happened has been heard of
ESTOPS = 7
STOPPED = 2  # ticks with the e-stop until the motor must be at zero
HOGGED, FLOODED = 4.0, 4.0  # s
HOGS = 2  # a core
FLOOD_RATE = 10_000.0  # Hz
MOVED = 0.5  # [mm] of the handle during a flood: the hand's own play
KILL, STOP = "kill -9", "SIGSTOP"
DRIVER, DEVICE, SIMULATION, RECORDER = "haptic_driver", "haptic_loopback", "haptic_simulation", "haptic_recorder"
CUT, SILENT = "device_watchdog", "device_silent"


class Event(NamedTuple):
    """run: (injector) → Figures; safe: bound of its time to safety [ms]; faults: that it may latch."""

    name: str
    run: Callable[[FaultInjector], figures.Figures]
    safe: float | None = None
    faults: tuple[str, ...] = ()


def taken(how: str, name: str) -> Callable[[FaultInjector], figures.Figures]:
    """A node is killed and started anew, or stopped and continued, while the wall is pressed."""

    def run(injector):
        injector.press()
        injector.kill(name) if how == KILL else injector.freeze(name)
        last = injector.heartbeat()
        injector.wait(GONE)
        heard = injector.listener.heard()
        if name in (DRIVER, DEVICE):
            injector.release()
        began = time.monotonic()
        injector.start(name) if how == KILL else injector.thaw(name)
        if name == RECORDER:
            injector.until(lambda: RECORDER in injector.listener.statuses, PATIENCE, "the recorder")
            return figures.figures(injector.listener.heard(), recovered=time.monotonic() - began)
        if name == SIMULATION:
            recovered = _rejoined(injector, began)
            heard = injector.listener.heard()
            return figures.figures(heard, figures.coupling_off(heard.rows), recovered)
        if how == KILL:
            injector.listener.mark_session()
        safe = figures.motor_off(heard.truths, last) if name == DRIVER else figures.found_silent(heard.rows)
        return _enabled(injector, safe, began)

    return run


def estop(injector: FaultInjector) -> figures.Figures:
    """~/estop while the wall is pressed, several times; safe is the median from the call to the motor at zero."""
    times, heards, ticks = [], [], 0
    for _ in range(ESTOPS):
        injector.begin()
        injector.press()
        called = time.monotonic()
        injector.listener.call("estop")
        injector.wait(HEARD)
        heards.append(injector.listener.heard())
        told = figures.told_to_zero(heards[-1].rows, called, enable_state.ESTOP)
        times.append(max(told or math.inf, figures.motor_off(heards[-1].truths, called)))
        ticks = max(ticks, figures.ticks_to_zero(heards[-1].rows, enable_state.ESTOP))
        injector.release()
    note = f"{ticks} tick after the driver has it; worst {max(times):.1f} ms"
    found = figures.worst([figures.figures(heard) for heard in heards])
    wrong = ("ticks",) if ticks > STOPPED else ()
    return found._replace(safe=statistics.median(times), recovered=injector.enable(), note=note, wrong=wrong)


def hogs(injector: FaultInjector) -> figures.Figures:
    """Busy processes on every core, while the wall is pressed."""
    before = _missed(injector)
    burning = [_process([sys.executable, "-c", "while True: pass"]) for _ in range(HOGS * (os.cpu_count() or 1))]
    try:
        injector.press()
        injector.wait(HOGGED)
    finally:
        for process in burning:
            process.kill()
            process.communicate()
    injector.release()
    recovered = injector.enable()
    rows, missed = injector.listener.heard().rows, _missed(injector) - before
    level = LEVELS[injector.listener.levels.get("haptic_driver: margin", 0)]
    note = f"{missed:.0f} ticks missed; margin down to {rows['margin'][:, 0].min():.3g} N s/m, which it calls {level}"
    return figures.figures(injector.listener.heard(), recovered=recovered, note=note)


def flood(injector: FaultInjector) -> figures.Figures:
    """10 kHz of foreign, mutated and meaningless messages on the topics of the exchange; the hand holds still."""
    before = _refusals(injector)
    said, _ = _process([*COMMAND, str(FLOOD_RATE), str(FLOODED)]).communicate(timeout=FLOODED + PATIENCE)
    rate = int((said.split(SENT) + ["0"])[1] or 0) / FLOODED
    injector.wait(0.6)
    refused, recovered, heard = _refusals(injector) - before, injector.enable(), injector.listener.heard()
    moved = 1e3 * float(abs(heard.truths["x"] - heard.truths["x"][0]).max())
    note = f"{rate:.0f} messages/s; {refused} refused and counted; handle moved {moved:.3f} mm"
    bounds = {"rate": rate > 0.9 * FLOOD_RATE, "refused": refused > 0, "moved": moved < MOVED}
    wrong = tuple(name for name, kept in bounds.items() if not kept)
    return figures.figures(heard, recovered=recovered, note=note, wrong=wrong)


def in_order(order: tuple[str, ...]) -> Callable[[FaultInjector], figures.Figures]:
    """All three nodes killed, and started again in this order; recovered counts from the last start."""

    def run(injector):
        injector.press()
        for name in random.sample(NODES, len(NODES)):
            injector.kill(name)
        injector.release()
        injector.wait(HEARD)  # or the last ticks of the killed driver are taken for those of the new one
        for name in order:
            injector.start(name)
        injector.listener.mark_session()
        return _enabled(injector, None, time.monotonic())

    return run


def _enabled(injector, safe, began):
    """Enables it again, and hears how the forces rise; recovered counts from `began` [s of the clock]."""
    injector.enable()
    recovered = time.monotonic() - began
    injector.wait(figures.AFTER)
    return figures.figures(injector.listener.heard(), safe, recovered)


def _rejoined(injector, began):
    """Seconds until a simulation is back while the hand still presses."""
    injector.until(lambda: injector.engaged or injector.faulty, PATIENCE, "the simulation")
    if injector.faulty:
        injector.release()
        injector.enable()
    recovered = time.monotonic() - began
    injector.wait(GONE)
    injector.release()
    return recovered


def _missed(injector):
    return max(0.0, number(injector.listener.said(DRIVER, "missed")))  # 0 where it says none


def _refusals(injector):
    """Everything that the nodes say they have refused."""
    counts = (
        number(value)
        for said in injector.listener.statuses.values()
        for name, value in said.values.items()
        if name.startswith("refused") and name != "refused"
    )
    return sum(int(count) for count in counts if math.isfinite(count))


def _process(command):
    return subprocess.Popen(ending_with_us(command), stdout=subprocess.PIPE, text=True, env=own_environment())


SAFE = {DRIVER: (20.0, (CUT, SILENT)), SIMULATION: (201.0, ()), DEVICE: (22.0, (SILENT, CUT)), RECORDER: (None, ())}
EVENTS = (
    *(
        Event(f"{how} {name.removeprefix('haptic_')}", taken(how, name), *SAFE[name])
        for name in SAFE
        for how in (KILL, STOP)
        if (how, name) != (STOP, RECORDER)
    ),
    Event("e-stop", estop, 20.0, ("estop",)),
    Event("CPU hogs", hogs),
    Event("DDS flood", flood),
    *(
        Event("start " + ", ".join(name.removeprefix("haptic_") for name in order), in_order(order), None, (SILENT,))
        for order in itertools.permutations(NODES)
    ),
)
