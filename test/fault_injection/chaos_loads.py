# SPDX-License-Identifier: Apache-2.0
"""Events of chaos that take no node away but its peace: processor time, the network, the wall clock."""

import math
import os
import subprocess
import sys
import time

from fault_injection import chaos_figures as figures
from fault_injection.conductor import PATIENCE, Conductor
from fault_injection.flood import COMMAND, SENT
from haptic_device.process import ending_with_us, own_environment
from haptic_device.status import LEVELS, number

HOGGED, FLOODED, STEPPED = 4.0, 4.0, 0.4  # s
HOGS = 2  # a core
FLOOD_RATE = 10_000.0  # Hz
MOVED = 0.5  # [mm] of the handle during a flood: the hand's own play
CLOCK_STEP = 2.0  # s
BURN = "while True: pass"


def hogs(conductor: Conductor) -> figures.Figures:
    """Busy processes on every core, while the wall is pressed."""
    before = _number(conductor, "missed")
    burning = [_process([sys.executable, "-c", BURN]) for _ in range(HOGS * (os.cpu_count() or 1))]
    try:
        conductor.press()
        conductor.wait(HOGGED)
    finally:
        _end(burning)
    conductor.release()
    recovered = conductor.enable()
    rows = conductor.witness.heard().rows
    missed = _number(conductor, "missed") - before
    level = LEVELS[conductor.witness.levels.get("haptic_driver: margin", 0)]
    note = f"{missed:.0f} ticks missed; margin down to {rows['margin'][:, 0].min():.3g} N s/m, which it calls {level}"
    return figures.figures(conductor.witness.heard(), recovered=recovered, note=note)


def flood(conductor: Conductor) -> figures.Figures:
    """10 kHz of foreign, mutated and meaningless messages on the topics of the exchange; the hand holds still."""
    before = _refusals(conductor)
    flooding = _process([*COMMAND, str(FLOOD_RATE), str(FLOODED)])
    flooding.wait(FLOODED + PATIENCE)
    sent = int((flooding.stdout.read().split(SENT) + ["0"])[1] or 0)
    conductor.wait(0.6)
    refused = _refusals(conductor) - before
    recovered = conductor.enable()
    heard = conductor.witness.heard()
    moved = 1e3 * float(abs(heard.truths["x"] - heard.truths["x"][0]).max())
    rate = sent / FLOODED
    note = f"{rate:.0f} messages/s; {refused} refused and counted; handle moved {moved:.3f} mm"
    bounds = {"rate": rate > 0.9 * FLOOD_RATE, "refused": refused > 0, "moved": moved < MOVED}
    wrong = tuple(name for name, kept in bounds.items() if not kept)
    return figures.figures(heard, recovered=recovered, note=note, wrong=wrong)


def step_clock(conductor: Conductor) -> figures.Figures:
    """The wall clock steps ahead and back, where that is allowed."""
    conductor.press()
    try:
        _step(CLOCK_STEP)
        try:
            conductor.wait(STEPPED)
        finally:
            _step(-CLOCK_STEP)
        conductor.wait(STEPPED)
        note = f"stepped {CLOCK_STEP:g} s ahead and back"
    except PermissionError:
        note = "not allowed here"
    conductor.release()
    recovered = conductor.enable()
    return figures.figures(conductor.witness.heard(), recovered=recovered, note=note)


def _step(seconds):
    time.clock_settime(time.CLOCK_REALTIME, time.clock_gettime(time.CLOCK_REALTIME) + seconds)


def _number(conductor, entry):
    return max(0.0, number(conductor.witness.said("haptic_driver", entry)))  # 0 where it says none


def _refusals(conductor):
    """Everything that the nodes say they have refused."""
    counts = (
        number(value)
        for said in conductor.witness.statuses.values()
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
