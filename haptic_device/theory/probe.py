# SPDX-License-Identifier: Apache-2.0
"""Finding the Z-width of a display that is there, be it live or in lock-step: gestures of the hand, and what they show.

Stiff end: a tap and a press on the wall at rising K, until the pressed handle keeps shaking and the hand keeps getting
energy. Free end: the damping that the hand feels on a circle.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from haptic_device.theory.quantity import Array

TAP, AWAY, PRESS, HELD, GESTURE = 0.1, 0.25, 0.8, 1.0, 2.0  # [s] of the gesture: a tap until, pressed from, looked at
COARSE, HARDLY = 1e-3, 0.5  # [m] travel that is shaking even where it fades, unless to less than this share
LASTS = 0.8  # share of the shaking of the first half of that time that is still there in the second: it does not settle
STEPS = 6.0  # encoder steps, peak to peak, that a handle at rest may move
POWER = 2e-6  # [W] given to the hand on end that counts as generated
RISE, PRECISION = 1.15, 0.02
CIRCLE, SLOW, FAST = 4.0, 0.5, 2.0  # [s] of the circle; turns a second in the beginning and in the end
BEGIN, WINDOW = 0.5, 0.1  # [s] left out in the beginning; over which energies are balanced
GAP = 0.02  # [s] between two truths, beyond which such a balance is left out: on a busy machine some are lost


class GroundTruth(NamedTuple):
    """What the hand got, each (samples): time [s], x [m], velocities along x and y [m/s], energy given to it [J]."""

    time: Array
    position: Array
    velocity_x: Array
    velocity_y: Array
    energy_given: Array


class Boundary(NamedTuple):
    """Stiffest wall that stood still and softest that shook [N/m]; None where the search ended before."""

    quiet: float | None
    shaking: float | None

    @property
    def stiffness(self) -> float:
        """The middle of both [N/m], or the one there is."""
        known = [value for value in self if value is not None]
        return sum(known) / len(known)


def tap_and_press(elapsed: float, out: float, depth: float) -> float:
    """Where the hand's target is, along the wall's normal from its surface [m]: `out` before it, `depth` in it."""
    if elapsed < TAP:
        return -depth
    if elapsed < AWAY:
        return out
    return out - (out + depth) * min(1.0, (elapsed - AWAY) / (PRESS - AWAY))


def shakes(truth: GroundTruth, began: float, resolution: float) -> bool:
    """Whether the pressed handle goes on moving, by more than encoder steps, and the hand goes on getting energy.

    A millimetre of travel, so long after the touch, is shaking even if it fades slowly.
    """
    middle = 0.5 * (HELD + GESTURE)
    early = (truth.time >= began + HELD) & (truth.time < began + middle)
    late = (truth.time >= began + middle) & (truth.time < began + GESTURE)
    if min(early.sum(), late.sum()) < 10:
        raise ValueError(f"the truth came only {late.sum()} times in {GESTURE - middle:g} s; is the loopback running?")
    travel = np.ptp(truth.position[late])
    given = truth.energy_given[late][-1] - truth.energy_given[late][0]
    before = np.ptp(truth.position[early])
    lasting = travel > max(STEPS * resolution, LASTS * before) and given > POWER * (GESTURE - middle)
    return bool(lasting or travel > max(COARSE, HARDLY * before))


def find_boundary(show: Callable[[float], bool], begin: float, most: float) -> Boundary:
    """Raises K from `begin` until show(K) says that the wall shakes, then halves the interval to PRECISION.

    Where the first wall shakes already, it is lowered until one stands still.
    """
    quiet = shaking = None
    stiffness = begin
    while (quiet is None or shaking is None) and begin / 100.0 < stiffness <= most:
        if show(stiffness):
            shaking, stiffness = stiffness, stiffness / RISE
        else:
            quiet, stiffness = stiffness, stiffness * RISE
    while quiet and shaking and shaking - quiet > PRECISION * shaking:
        middle = 0.5 * (quiet + shaking)
        quiet, shaking = (quiet, middle) if show(middle) else (middle, shaking)
    return Boundary(quiet, shaking)


def circle(elapsed: float, radius: float) -> tuple[float, float]:
    """Point (x, y) of the hand's target from where it begins [m], on a circle run faster and faster."""
    angle = 2.0 * np.pi * elapsed * (SLOW + 0.5 * (FAST - SLOW) * elapsed / CIRCLE)
    return radius * (np.cos(angle) - 1.0), radius * np.sin(angle)


def apparent_damping(truth: GroundTruth, began: float) -> float:
    """Damping that the hand feels in free space [N s/m].

    The energy it gives over each window is regressed on ∫ v² dt (damping), the path (friction) and the change of v²/2
    (mass): the truth integrates it exactly, whatever the hand's force does between two samples, and the speed changes
    along the circle, so that the three can be told apart. Raises ValueError if the handle hardly moved, or too little
    of it came.
    """
    if truth.time.size < 2:
        raise ValueError(f"the truth came {truth.time.size} times; is the loopback running?")
    edges = np.arange(began + BEGIN, began + CIRCLE, WINDOW)
    at = np.unique(np.searchsorted(truth.time, edges[edges < truth.time[-1]]))
    square = truth.velocity_x**2 + truth.velocity_y**2
    if at.size < 10 or np.ptp(square) < 1e-5:
        raise ValueError(
            "the handle hardly moved; does the loopback's hand follow operator/target (motion.name follow)?"
        )
    step = np.diff(truth.time, prepend=truth.time[0])
    sums = [np.cumsum(column * step)[at] for column in (square, np.sqrt(square))]
    whole = np.maximum.reduceat(step, at[:-1] + 1) <= GAP
    if whole.sum() < 10:
        raise ValueError(f"only {whole.sum()} tenths of a second of the circle came whole; is the machine too busy?")
    columns = np.diff(np.stack([*sums, 0.5 * square[at]]), axis=1).T[whole]
    return float(np.linalg.lstsq(columns, -np.diff(truth.energy_given[at])[whole], rcond=None)[0][0])
