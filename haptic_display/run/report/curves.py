# SPDX-License-Identifier: Apache-2.0
"""What a report draws of a run as curves: over time, or over another scale. What the run lacks is a ValueError.

Every pair of lines differs by its dashes too, so that it can be read in grey. A long line is drawn as the envelope of
its ticks: no peak is lost.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from haptic_device.digits import amount, plain
from haptic_device.theory.palette import BLUE, DASHED, DOTTED, GREEN, ORANGE, PURPLE, SOLID, VERMILION, Dashes
from haptic_device.theory.quantity import Array
from haptic_display.run.report.conditions import period
from haptic_display.run.report.run import Run

Values = npt.NDArray[np.floating]

COLOURS, NAMES = (BLUE, VERMILION, GREEN), ("x", "y", "θ")
POINTS = 2000  # of one line; more than a page resolves
_DASHES = {"handle": SOLID, "tool": DASHED, "on handle": SOLID, "of the coupling": DASHED}
_ALIKE = 0.02  # of an axis: the width of a line
_EDGES = 80  # of a histogram


class Curve(NamedTuple):
    """One line: what it shows, its points, its look; steps: of a histogram, whose x are edges."""

    name: str
    x: Values
    y: Values
    colour: str
    dashes: Dashes = SOLID
    steps: bool = False


def positions(run: Run, axes: Sequence[int] = (0, 1)) -> list[Curve]:
    """Handle and tool, x and y over time [s, mm]."""
    return [
        Curve(f"{what} {NAMES[i]}", time, place * 1e3, COLOURS[i], _DASHES[what])
        for i in axes
        for what, (time, place) in run.places(i).items()
    ]


def distances(run: Run) -> list[Curve]:
    """Handle to tool in the plane, over time [s, mm]."""
    return [Curve("handle to tool", run.seconds[run.rows["tool_age"] >= 0], run.distance * 1e3, BLUE)]


def angles(run: Run) -> list[Curve]:
    """Handle and tool, angle over time [s, degrees]."""
    colours = {"handle": GREEN, "tool": PURPLE}
    return [
        Curve(f"{what} θ", time, np.degrees(angle), colours[what], _DASHES[what])
        for what, (time, angle) in run.places(2).items()
    ]


def forces(run: Run) -> list[Curve]:
    """Force on the handle, and the coupling's part of it, x and y over time [s, N]."""
    colours = {"on handle": COLOURS, "of the coupling": (ORANGE, PURPLE)}
    return [
        Curve(f"{what}, {NAMES[i]}", time, force, colours[what][i], _DASHES[what])
        for i in range(2)
        for what, (time, force) in run.forces(i).items()
    ]


def energies(run: Run) -> list[Curve]:
    """Energy given to the operator by the truth and by the servo's account, and to the tool, over time [s, mJ]."""
    found = []
    try:
        found.append(Curve("to the operator, truth", run.ground_truth_seconds, run.given * 1e3, BLUE))
    except ValueError:
        if not run.traced:
            raise
    if run.traced:
        found.append(Curve("to the operator, servo's account", run.seconds, run.booked * 1e3, ORANGE, DASHED))
        name = "to the tool, by the samples at the servo"
        found.append(Curve(name, run.seconds, run.tool_energy * 1e3, GREEN, DOTTED))
    return found


def margins(run: Run) -> list[Curve]:
    """Physical damping left over by the gains in force, as a share of b, over time [s, %]."""
    damping, margin = run.physical_damping, run.rows["margin"]
    if not np.isfinite(damping).any():
        raise ValueError("the driver did not say its physical damping")
    return [
        Curve(NAMES[i], run.seconds, margin[:, i] / damping[i] * 100, COLOURS[i], (SOLID, DASHED, DOTTED)[i])
        for i in range(3)
        if np.isfinite(damping[i])
    ]


def lateness(run: Run) -> list[Curve]:
    """Histograms of wake-up after the deadline and of the tick's own work [µs, ticks]."""
    late, compute = (np.maximum(_finite(run.rows[name]) * 1e6, 0.1) for name in ("lateness", "compute"))
    if not len(late) or not len(compute):
        raise ValueError("lateness and compute are no numbers")
    if not run.rows["lateness"].any():
        raise ValueError("it was not measured: lateness is 0 in every tick")
    edges = np.geomspace(0.1, max(late.max(), compute.max()) * 1.01, _EDGES)
    return [
        _histogram("wake-up after the deadline", late, edges, BLUE),
        _histogram("time of the tick's own work", compute, edges, ORANGE, DASHED),
    ]


def one_period(run: Run) -> list[tuple[float, str]]:
    """The servo's period [µs], and its name."""
    return [(period(run.rows) * 1e6, "one period T")]


def ages(run: Run) -> list[Curve]:
    """Histogram of the age of the tool sample in use [ms, ticks]."""
    age = _age(run)
    edges = np.linspace(0.0, np.percentile(age, 99.9) * 1.2 + 0.1, _EDGES)
    return [_histogram("age", age, edges, GREEN)]


def median_age(run: Run) -> list[tuple[float, str]]:
    """The median age of the tool sample in use [ms], and its name."""
    middle = float(np.median(_age(run)))
    return [(middle, f"median {plain(middle, 'ms')}")]


def spectrum(run: Run) -> list[Curve]:
    """Power density of the force on the handle [Hz, N²/Hz]."""
    found = run.spectrum
    return [Curve("x and y together", found.frequency[1:], np.maximum(found.density[1:], 1e-18), BLUE)]


def oscillation(run: Run) -> list[tuple[float, str]]:
    """Frequency [Hz] of an oscillation, and its name with its force."""
    line = run.spectrum.oscillation
    return [(line.frequency, f"{plain(line.frequency, 'Hz')}, {amount(line.force, 'N')} RMS")] if line else []


def once(found: Sequence[Curve], span: float) -> list[Curve]:
    """The curves, those that no eye tells apart on an axis of this span as one: `a = b`; none without points."""
    kept: list[Curve] = []
    for curve in (curve for curve in found if len(curve.x)):
        for place, one in enumerate(kept):
            if np.abs(np.interp(one.x, curve.x, curve.y) - one.y).max() < _ALIKE * span:
                kept[place] = one._replace(name=f"{one.name} = {curve.name}")
                break
        else:
            kept.append(curve)
    return kept


def range_of(found: Sequence[Curve], least: float) -> tuple[float, float]:
    """Limits of an axis that shows them all, with a border; not closer than the least."""
    values = _finite(np.concatenate([curve.y for curve in found]))
    low, high = (values.min(), values.max()) if len(values) else (0.0, 0.0)
    border = max(0.05 * (high - low), (least - (high - low)) / 2)
    return float(low - border), float(high + border)


def thin(x: Values, y: Values) -> tuple[Values, Values]:
    """At most 2 POINTS of a line: the least and the largest value of each stretch."""
    if len(y) <= 2 * POINTS:
        return x, y
    begins = np.linspace(0, len(y), POINTS, endpoint=False).astype(int)
    ends = np.stack([np.fmin.reduceat(y, begins), np.fmax.reduceat(y, begins)], axis=1).ravel()
    return np.repeat(x[begins], 2), ends


def _age(run: Run) -> Array:
    """[ms]. Raises ValueError if no tool sample was used."""
    age = run.rows["tool_age"][run.rows["tool_age"] >= 0].astype(float) * 1e3
    if not len(age):
        raise ValueError("no tool sample was ever used")
    return age


def _histogram(name: str, values: Values, edges: Array, colour: str, dashes: Dashes = SOLID) -> Curve:
    counts = np.histogram(values, edges)[0].astype(float)
    return Curve(name, edges, np.append(counts, 0.0), colour, dashes, steps=True)


def _finite(values: Values) -> Values:
    return values[np.isfinite(values)]
