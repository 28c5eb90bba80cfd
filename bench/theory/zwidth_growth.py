# SPDX-License-Identifier: Apache-2.0
"""How the stiffest wall that stands still grows with the servo's rate, on live nodes.

Five turns of the search of `haptic zwidth --live` unless told, at 1 and 10 kHz one after the other; the median of the
turns' ratios. A turn in which the machine stalled is done again, and said.
"""

import contextlib
import statistics
from typing import Annotated

import typer

from haptic_device.analysis import probe
from haptic_device.config_files import find
from haptic_device.description import load_device
from haptic_sim.supervision.pair import running
from haptic_sim.supervision.tuning import Tuning
from haptic_sim.supervision.zwidth import STALLED, TOUCHED, LiveDisplay, pair

RATES = 1000.0, 10000.0


def stiffest(path, rate):
    """Largest K [N/m] at which no touch shows a wall without damping to shake."""
    device = load_device(path)
    bound = 2.0 * device.axes[0].damping * rate
    nodes = running(None, None, *pair(str(path), rate))
    with nodes as (number, room, check), contextlib.closing(Tuning(number, room)) as tuning:
        tuning.wait_engaged(check)
        with tuning.as_found(TOUCHED):
            display = LiveDisplay(tuning, 0.0, 1.0 / device.axes[0].counts_per_unit)
            display.free()
            return probe.find_boundary(display.show, 0.95 * bound, 20.0 * bound).quiet


def main(turns: Annotated[int, typer.Argument(min=1)] = 5) -> None:
    """How the stiffest wall that stands still grows with the servo's rate, on live nodes."""
    path, ratios = find("devices", "desktop"), []
    while len(ratios) < turns:
        try:
            walls = [stiffest(path, rate) for rate in RATES]
        except ValueError as error:
            if not any(name in str(error) for name in STALLED):
                raise
            print(f"a turn that does not count: {error}", flush=True)
            continue
        ratios.append(walls[1] / walls[0])
        slow, fast = (wall / 1e3 for wall in walls)
        print(f"turn {len(ratios)}: {slow:.2f} kN/m at 1 kHz, {fast:.1f} at 10: {ratios[-1]:.1f} times", flush=True)
    print(f"median of {turns}: {statistics.median(ratios):.1f} times")
