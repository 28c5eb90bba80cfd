# SPDX-License-Identifier: Apache-2.0
"""The impedance that a display shows, fitted to a recording: mass, damping, stiffness, each with its confidence.

f = m a + b v + k x + c, by least squares; f: force that has to push against it, c: one constant for each contact.

The display's force also has noise of its own, which moves the handle: fitted sample by sample, the device's mass comes
out of it with the wrong sign (closed-loop identification; Ljung 1999, ch. 13). It is faster than a hand, so all four
columns are first averaged over 40 ms, which any such law passes unchanged. Noise slower than that still makes the mass
too small.

What is left errs alike for longer than a sample, and nobody says for how long. So the confidence is that of a jackknife
over whole stretches of time (Efron 1982), the widest of several lengths, with Student's t. It says how well this law is
known from this recording, not whether the law is the right one.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from haptic_device.theory.quantity import Array

STRETCHES = (24, 12, 6)  # into which the time is cut
HAND = 0.04  # [s] of the moving mean; a hand's motion passes it
LEAST = 100  # samples below which nothing is fitted
CONFIDENCE = 0.95
HELD_WINDOW = 0.05  # [s]
HELD_SHARE = 0.1  # of the handle's way, up to which the tool counts as standing still
HELD_WAY = 20e-6  # [m | rad] that the handle has to move in a window to tell something


class Estimate(NamedTuple):
    """A value and how well it is known.

    Attributes:
        value: the value.
        error: half width of its 95 % confidence interval, in the same unit.

    Examples:
        >>> from haptic_display.run.report.impedance import Estimate
        >>> stiffness = Estimate(998.0, 5.0)
        >>> abs(stiffness.value - 1000.0) < stiffness.error
        True
    """

    value: float
    error: float


class Impedance(NamedTuple):
    """Mass, damping and stiffness that a display shows, as `fit` finds them.

    Attributes:
        mass: [kg | kg m²].
        damping: [N s/m | N m s/rad].
        stiffness: [N/m | N m/rad].
        explained: share of the force's variance that the law explains, r².
        samples: samples of the fit.

    Examples:
        >>> import numpy as np
        >>> from haptic_display.run.report.impedance import fit
        >>> time = np.arange(0.0, 4.0, 0.001)
        >>> found = fit(time, np.sin(time), np.cos(time), 500.0 * np.sin(time))
        >>> round(found.explained, 6)  # a spring, and nothing else
        1.0
    """

    mass: Estimate
    damping: Estimate
    stiffness: Estimate
    explained: float
    samples: int


def fit(
    time: Array, position: Array, velocity: Array, force: Array, groups: npt.NDArray[np.int_] | None = None
) -> Impedance | None:
    """Fits f = m a + b v + k x + c to the force of one axis, by least squares.

    Samples that are not finite are left out. Returns None if there are too few samples, or if the axis hardly moved.
    The method is in the docstring of this module.

    Args:
        time: rising [s], (samples).
        position: of the handle [m | rad], (samples).
        velocity: of the handle [m/s | rad/s], (samples).
        force: needed to push against the display [N | N m], (samples).
        groups: number of the contact of each sample; each contact has its own constant c.

    Examples:
        >>> import numpy as np
        >>> from haptic_display.run.report.impedance import fit
        >>> t = np.arange(0.0, 4.0, 0.001)
        >>> x, v, a = np.sin(t) + np.sin(5 * t), np.cos(t) + 5 * np.cos(5 * t), -np.sin(t) - 25 * np.sin(5 * t)
        >>> found = fit(t, x, v, 0.2 * a + 3.0 * v + 500.0 * x)
        >>> round(found.mass.value, 4), round(found.damping.value, 4), round(found.stiffness.value, 3)
        (0.2, 3.0, 500.0)
    """
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if not step > 0.0:
        return None
    columns = np.stack([_derivative(time, velocity, groups), velocity, position, force], axis=1)
    width = max(1, round(HAND / step))
    columns, begins = _means(columns.astype(float), width)
    if len(begins) < LEAST:
        return None
    columns = _centred(columns, np.zeros(len(begins), int) if groups is None else groups[begins])
    columns, target = columns[:, :3], columns[:, 3]
    scale = columns.std(axis=0)
    if (scale <= 0.0).any() or target.std() <= 0.0:
        return None
    return _estimates(columns / scale, target, scale)


def held_still(time: Array, tool: Array, position: Array) -> npt.NDArray[np.bool_]:
    """Whether the tool, or a wall, stood still in this axis while the handle moved, (samples), in windows of 50 ms.

    Args:
        time: rising [s], (samples).
        tool: position of the tool [m | rad], (samples).
        position: of the handle [m | rad], (samples).

    Examples:
        >>> import numpy as np
        >>> from haptic_display.run.report.impedance import held_still
        >>> time = np.arange(0.0, 1.0, 0.001)
        >>> bool(held_still(time, np.zeros(1000), 0.01 * time).all())
        True
    """
    begins = np.flatnonzero(np.diff(np.floor(time / HELD_WINDOW), prepend=-1.0))
    ways = [np.maximum.reduceat(x, begins) - np.minimum.reduceat(x, begins) for x in (tool, position)]
    held = (ways[0] < HELD_SHARE * ways[1]) & (ways[1] > HELD_WAY)
    return np.repeat(held, np.diff(np.append(begins, len(time))))


def _means(columns: Array, width: int) -> tuple[Array, npt.NDArray[np.intp]]:
    """Means of so many neighbours, and the index of each one's first; only where every value is a number.

    The derivative is none at the ends of a group, so no mean reaches from one group into another.
    """
    finite = np.atleast_1d(np.isfinite(columns).all(axis=1))
    sums = np.cumsum(np.pad(np.where(finite[:, None], columns, 0.0), ((1, 0), (0, 0))), axis=0)
    counts = np.cumsum(np.pad(finite.astype(int), (1, 0)))
    begins = np.flatnonzero(counts[width:] - counts[:-width] == width)
    return (sums[begins + width] - sums[begins]) / width, begins


def _derivative(time: Array, values: Array, groups: npt.NDArray[np.int_] | None) -> Array:
    """Central difference; NaN at the ends, and where a neighbour is of another group or samples are missing."""
    rate = np.full(len(time), np.nan)
    if len(time) < 3:
        return rate
    span = time[2:] - time[:-2]
    rate[1:-1] = (values[2:] - values[:-2]) / np.where(span > 0.0, span, np.nan)
    broken = span > 3.0 * np.median(span)
    if groups is not None:
        broken |= groups[2:] != groups[:-2]
    rate[1:-1][broken] = np.nan
    return rate


def _centred(columns: Array, groups: npt.NDArray[np.int_]) -> Array:
    """Columns less their mean in each group: the constants c are fitted by that."""
    _, index = np.unique(groups, return_inverse=True)
    counts = np.bincount(index)[:, None]
    means = np.stack([np.bincount(index, column) for column in columns.T], axis=1) / counts
    return columns - means[index]


def _estimates(columns: Array, target: Array, scale: Array) -> Impedance:
    solution = np.linalg.pinv(columns.T @ columns) @ (columns.T @ target)
    width = np.max([_half_width(columns, target, solution, count) for count in STRETCHES], axis=0)
    rest = target - columns @ solution
    mass, damping, stiffness = map(Estimate, (solution / scale).tolist(), (width / scale).tolist())
    return Impedance(mass, damping, stiffness, float(1.0 - rest.var() / target.var()), len(target))


def _half_width(columns: Array, target: Array, solution: Array, count: int) -> Array:
    """Half width of each interval, from how much the solution moves when one of `count` stretches is left out."""
    parts = list(zip(np.array_split(columns, count), np.array_split(target, count), strict=True))
    squares, products = np.array([x.T @ x for x, _ in parts]), np.array([x.T @ y for x, y in parts])
    without = np.linalg.pinv(squares.sum(axis=0) - squares) @ (products.sum(axis=0) - products)[..., None]
    variance = ((without[..., 0] - solution) ** 2).sum(axis=0) * (count - 1) / count
    return stats.t.ppf(0.5 + CONFIDENCE / 2, count - 1) * np.sqrt(variance)
