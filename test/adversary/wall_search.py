# SPDX-License-Identifier: Apache-2.0
"""Looks for the handle path that draws most energy from a unilateral wall, by L-BFGS-B from random paths.

The laws are the servo's: velocity estimate behind its lag, force held over the tick that follows or one some ticks
later, clamped so that the wall does not pull, and damping cancelled outside (ρ b v̂, faded over a band; a hard switch
where the band is 0). K, T and the longest step are 1: B and b are in KT, the band is in longest steps. A path begins at
rest, in the wall perhaps, but then the spring's store is what it is charged: to come there slowly costs no more. Energy
that is left over was nobody's before.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from haptic_device.control import damping_compensation, velocity_estimator, virtual_wall


class Display(NamedTuple):
    """b and B [KT], velocity lag [T], whole samples of delay, share ρ cancelled outside, band [longest steps]."""

    physical_damping: float
    damping: float = 0.0
    lag: float = 0.0
    delay: int = 0
    cancelled: float = 0.0
    band: float = 0.0


class Found(NamedTuple):
    """Energy over what there was at the start, in units of K · step²; and the path, depth in the wall in steps."""

    energy: float
    path: np.ndarray


def search(display, ticks, starts, seed=1, enough=np.inf):
    """The best of L-BFGS-B from so many random paths of so many ticks; its energy is 0 where none draws any.

    It ends early with a path that draws more than enough.

    Every other path is pinned to pass the surface exactly in a tick drawn at random: the force jumps there, and no
    gradient leads to it.
    """
    rng, best = np.random.default_rng(seed), Found(0.0, np.zeros(ticks + 1))
    for start in range(starts):
        pin = int(rng.integers(1, ticks)) if start % 2 else None
        path = _climb(display, rng.choice([0.03, 0.3, 1.0]) * rng.uniform(-1.0, 1.0, ticks), rng.uniform(0.0, 5.0), pin)
        energy = energy_left(display, path)
        best = Found(energy, path) if energy > best.energy else best
        if best.energy > enough:
            break
    return best


def energy_left(display, path):
    """Energy given to the operator along positions one tick apart, less the spring's store at the first."""
    given, rate, before = -0.5 * max(0.0, path[0]) ** 2, 0.0, path[0]
    waiting = [_force(display, path[0], 0.0)] * display.delay
    for k in range(len(path) - 1):
        rate, before = velocity_estimator.velocity_of(rate, path[k] - before, 1.0, display.lag), path[k]
        waiting.append(_force(display, path[k], rate))
        step = path[k + 1] - path[k]
        given += (waiting.pop(0) - display.physical_damping * step) * step
    return given


def _force(display, depth, rate):
    """Force on the handle, positive into the wall."""
    outside = float(depth <= 0.0)
    fade = damping_compensation.cancellation_fade(-depth, display.band, 0.0, 1.0) if display.band > 0.0 else outside
    pushed = virtual_wall.wall_force(1.0, display.damping, depth, rate)
    return display.cancelled * fade * display.physical_damping * rate - pushed


def _climb(display, steps, depth, pin):
    """Path after the search from these steps; begins at this depth, or passes the surface at the index pin."""

    def path_of(free):
        path = np.cumsum(np.concatenate([free[-1:], free[:-1]]))
        return path if pin is None else path - path[pin]

    def loss(free):
        energy, slope = _energy_and_slope(display, path_of(free))
        if pin is not None:
            slope[pin] -= slope.sum()
        later = np.cumsum(slope[::-1])[::-1]
        return -energy, -np.append(later[1:], later[0])

    bounds = [(-1.0, 1.0)] * steps.size + [(None, None)]
    return path_of(minimize(loss, [*steps, depth], jac=True, method="L-BFGS-B", bounds=bounds).x)


def _lagged(lag, values):
    """First-order lag by backward Euler, as of the servo's estimator."""
    return lfilter([1.0 / (1.0 + lag)], [1.0, -lag / (1.0 + lag)], values)


def _energy_and_slope(display, path):
    """energy_left and its derivative by the positions, wherever the force is smooth."""
    b, late, band = display.physical_damping, display.delay, display.band
    rate, step, ticks = _lagged(display.lag, np.diff(path, prepend=path[0])), np.diff(path), path.size - 1
    pushing = (path > 0.0) & (path + display.damping * rate > 0.0)
    fade = np.clip(-path / band, 0.0, 1.0) if band > 0.0 else (path <= 0.0).astype(float)
    force = display.cancelled * b * fade * rate - pushing * (path + display.damping * rate)
    source = np.maximum(np.arange(ticks) - late, 0)
    at_start = np.arange(ticks) < late
    held = np.where(at_start, -max(0.0, path[0]), force[source])
    energy = held @ step - b * step @ step - 0.5 * max(0.0, path[0]) ** 2
    moved = np.zeros(path.size)
    np.add.at(moved, source[~at_start], step[~at_start])
    fading = ((path < 0.0) & (path > -band)) / -band if band > 0.0 else 0.0
    slope = moved * (display.cancelled * b * fading * rate - pushing)
    by_rate = moved * (display.cancelled * b * fade - display.damping * pushing)
    by_step = held - 2.0 * b * step + _lagged(display.lag, by_rate[::-1])[-2::-1]
    slope[1:] += by_step
    slope[:-1] -= by_step
    slope[0] -= max(0.0, path[0]) + (path[0] > 0.0) * step[at_start].sum()
    return energy, slope
