# SPDX-License-Identifier: Apache-2.0
"""Events of chaos that take no node away but its peace: processor time, the network, the wall clock."""

import math
import os
import subprocess
import sys
import time

from fault_injection import chaos_figures as figures
from fault_injection.fault_injector import PATIENCE, FaultInjector
from fault_injection.flood import COMMAND, SENT
from haptic_device.process import ending_with_us, own_environment
from haptic_device.status import LEVELS, number

HOGGED, FLOODED, STEPPED = 4.0, 4.0, 0.4  # s
HOGS = 2  # a core
FLOOD_RATE = 10_000.0  # Hz
MOVED = 0.5  # [mm] of the handle during a flood: the hand's own play
CLOCK_STEP = 2.0  # s
BURN = "while True: pass"


def hogs(injector: FaultInjector) -> figures.Figures:
    """Busy processes on every core, while the wall is pressed."""
    before = _number(injector, "missed")
    burning = [_process([sys.executable, "-c", BURN]) for _ in range(HOGS * (os.cpu_count() or 1))]
    try:
        injector.press()
        injector.wait(HOGGED)
    finally:
        _end(burning)
    injector.release()
    recovered = injector.enable()
    rows = injector.listener.heard().rows
    missed = _number(injector, "missed") - before
    level = LEVELS[injector.listener.levels.get("haptic_driver: margin", 0)]
    note = f"{missed:.0f} ticks missed; margin down to {rows['margin'][:, 0].min():.3g} N s/m, which it calls {level}"
    return figures.figures(injector.listener.heard(), recovered=recovered, note=note)


def flood(injector: FaultInjector) -> figures.Figures:
    """10 kHz of foreign, mutated and meaningless messages on the topics of the exchange; the hand holds still."""
    before = _refusals(injector)
    flooding = _process([*COMMAND, str(FLOOD_RATE), str(FLOODED)])
    flooding.wait(FLOODED + PATIENCE)
    sent = int((flooding.stdout.read().split(SENT) + ["0"])[1] or 0)
    injector.wait(0.6)
    refused = _refusals(injector) - before
    recovered = injector.enable()
    heard = injector.listener.heard()
    moved = 1e3 * float(abs(heard.truths["x"] - heard.truths["x"][0]).max())
    rate = sent / FLOODED
    note = f"{rate:.0f} messages/s; {refused} refused and counted; handle moved {moved:.3f} mm"
    bounds = {"rate": rate > 0.9 * FLOOD_RATE, "refused": refused > 0, "moved": moved < MOVED}
    wrong = tuple(name for name, kept in bounds.items() if not kept)
    return figures.figures(heard, recovered=recovered, note=note, wrong=wrong)


def step_clock(injector: FaultInjector) -> figures.Figures:
    """The wall clock steps ahead and back, where that is allowed."""
    injector.press()
    try:
        _step(CLOCK_STEP)
        try:
            injector.wait(STEPPED)
        finally:
            _step(-CLOCK_STEP)
        injector.wait(STEPPED)
        note = f"stepped {CLOCK_STEP:g} s ahead and back"
    except PermissionError:
        note = "not allowed here"
    injector.release()
    recovered = injector.enable()
    return figures.figures(injector.listener.heard(), recovered=recovered, note=note)


def _step(seconds):
    time.clock_settime(time.CLOCK_REALTIME, time.clock_gettime(time.CLOCK_REALTIME) + seconds)


def _number(injector, entry):
    return max(0.0, number(injector.listener.said("haptic_driver", entry)))  # 0 where it says none


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


def _end(processes):
    for process in processes:
        process.kill()
        process.wait()
        process.stdout.close()
