# SPDX-License-Identifier: Apache-2.0
"""Speed of the Z-width map: core time of the kernel, and what two threads bring.

Device m = 0.1 kg, b = 0.5 N s/m, T = 1 ms; a tap without operator, 1 s a cell.
Error: the boundary against the eigenvalues.
"""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Annotated

import numpy as np
import typer

from haptic_device.analysis.stability import largest_stable_stiffness
from haptic_device.analysis.zwidth import Operator, Setup, run_cells
from reference.boundary import boundary_stiffness

SETUP, TAP = Setup(0.1, 0.5, 1e-3), Operator()


def main(points: Annotated[int, typer.Argument(min=1, help="Cells along each edge.")] = 100) -> None:
    """Core time of the map's kernel, and what two threads bring."""
    damping, stiffness = np.linspace(-0.5, 2.0, points), np.linspace(50.0, 6000.0, points)
    run_cells(SETUP, (TAP,), stiffness[:1], damping[:1])
    alone, core, giving = _map(1, stiffness, damping)
    both, _, _ = _map(2, stiffness, damping)
    ticks = points * points * SETUP.seconds / SETUP.period
    print(f"{points} x {points} cells of {SETUP.seconds:g} s, {ticks:.3g} ticks")
    print(f"core time {core:.2f} s, {1e9 * core / ticks:.0f} ns a tick")
    print(f"one thread {alone:.2f} s, two threads {both:.2f} s: scaling {alone / (2.0 * both):.2f}")
    print(f"energy given beyond what there was: {giving} of {points * points} cells")
    long = SETUP._replace(seconds=10.0)
    for value in (0.0, 1.0, 5.0):
        found = boundary_stiffness(long, (Operator(pressed=True),), value, 2e4)
        exact = largest_stable_stiffness(0.1, 0.5, value, 1e-3)
        error = 100.0 * (found / exact - 1.0)
        print(f"B = {value:g}: boundary {found:.1f} N/m, eigenvalues {exact:.1f} N/m, error {error:+.2f} %")


def _map(threads, stiffness, damping):
    """Wall time, core time [s] and the number of cells that gave energy."""
    began, busy = time.perf_counter(), time.process_time()
    with ThreadPoolExecutor(threads) as pool:
        rows = list(pool.map(lambda value: run_cells(SETUP, (TAP,), stiffness, value), damping))
    wall, core = time.perf_counter() - began, time.process_time() - busy
    return wall, core, sum(int(np.sum(row.energy_given > 0.0)) for row in rows)
