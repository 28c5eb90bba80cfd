# SPDX-License-Identifier: Apache-2.0
"""A mass on one axis, held by the coupling, between rigid stops, with dry friction: exact from event to event.

    m u'' = K (x_h - u) + B (x_h' - u') - F sign(u') + f        low <= u <= high, stops without rebound

Between two samples of the hand x_h and x_h' go straight, so that the state obeys a linear equation with a linear input,
solved by the matrix exponential; events (stop met or left, sliding begun or ended) are bracketed and found by Brent's
method to rounding.
"""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from haptic_sim.lockstep.error_metrics import Case

LOOKS = 8
"""Places in a piece of the path where events are looked for."""


class Axis(NamedTuple):
    """Mass [kg | kg m²], coupling, dry friction [N | N m], other force, stops."""

    mass: float
    stiffness: float
    damping: float
    friction: float = 0.0
    force: float = 0.0
    low: float = -math.inf
    high: float = math.inf


def axis_motion(axis: Axis, places, rates, period: float, start: float) -> np.ndarray:
    """Coordinate at each sample of the hand (places, rates at every `period` [s]); at rest at `start` before."""
    state, mode, found = np.array([start, 0.0]), _mode_at(axis, (start, 0.0), places[0], rates[0]), [start]
    for k in range(len(places) - 1):
        hand = np.array([places[k], rates[k]]), np.array([places[k + 1] - places[k], rates[k + 1] - rates[k]]) / period
        state, mode = _piece(axis, state, mode, hand, period)
        found.append(state[0])
    return np.array(found)


def seen(case: Case, axis: Axis, k: int, start: float) -> np.ndarray:
    """Coordinate k of a case at the looks, where it is led as this axis."""
    places, rates = case.path()[:, (k, k + 3)].T
    return axis_motion(axis, places, rates, case.period * 1e-9, start)[:: case.look // case.period]


def turning(case: Case) -> np.ndarray:
    """Angle of a tool at the looks that turns by itself on its coupling."""
    tool = case.scene.tool
    return seen(case, Axis(tool.mass_properties.inertia, *case.gains[2:]), 2, tool.pose[2])


def _piece(axis, state, mode, hand, period):
    done = 0.0
    for _ in range(50):
        here = hand[0] + done * hand[1], hand[1]
        after, event = _until_event(axis, state, mode, here, period - done)
        done += after
        state = _moved(axis, state, mode, here, after)
        if event is None:
            break
        mode, state = event(axis, state, hand[0] + done * hand[1])
    return state, mode


def _until_event(axis, state, mode, hand, left):
    """Time to the first event, at most `left`, and what follows: (axis, state, hand) -> mode, state; else None."""
    times = np.linspace(0.0, left, LOOKS + 1)
    first = left, None
    for watch, follows in _watches(axis, mode, hand):
        at = _first_fall(lambda t, watch=watch: watch(_moved(axis, state, mode, hand, t), t), times)
        first = min(first, (at, follows), key=lambda pair: pair[0])
    return first


def _first_fall(value, times):
    """When a value first falls below zero between two of these times; inf if it does not."""
    values = [value(time) for time in times]
    for (a, before), (b, after) in itertools.pairwise(zip(times, values, strict=True)):
        if before >= 0.0 > after:
            return a if before == 0.0 else brentq(value, a, b, xtol=1e-16)
    return math.inf


def _watches(axis, mode, hand):
    """(value that falls below zero at the event, what follows)."""
    if mode[0] == "slide":
        sign = mode[1]
        yield (lambda state, t: state[0] - axis.low), functools.partial(_stop, place=axis.low)
        yield (lambda state, t: axis.high - state[0]), functools.partial(_stop, place=axis.high)
        if sign:
            yield (lambda state, t: sign * state[1]), _stop
    else:

        def spare(state, t):
            push = _push(axis, state, hand[0] + t * hand[1])
            return min(mode[2] - push, push - mode[1])

        yield spare, _let_go


def _stop(axis, state, hand, place=None):
    state = np.array([state[0] if place is None else place, 0.0])
    return _mode_at(axis, state, *hand), state


def _let_go(axis, state, hand):
    return ("slide", math.copysign(1.0, _push(axis, state, hand)) if axis.friction > 0.0 else 0.0), state


def _mode_at(axis, state, place, rate):
    """What a mass at rest does: it slides if the push exceeds what friction and stops take."""
    push = _push(axis, state, (place, rate))
    least = -math.inf if state[0] <= axis.low else -axis.friction
    most = math.inf if state[0] >= axis.high else axis.friction
    if least <= push <= most and (axis.friction > 0.0 or math.isinf(least) or math.isinf(most)):
        return "hold", least, most
    return "slide", math.copysign(1.0, push) if axis.friction > 0.0 else 0.0


def _push(axis, state, hand):
    return axis.stiffness * (hand[0] - state[0]) + axis.damping * (hand[1] - state[1]) + axis.force


def _moved(axis, state, mode, hand, time):
    """State after `time` [s]; place and rate of the hand, their slopes and the force are five more states."""
    if mode[0] == "hold":
        return state
    force = (axis.force - mode[1] * axis.friction) / axis.mass
    moved = _transition(axis.stiffness / axis.mass, axis.damping / axis.mass, float(time))
    return moved @ [*state, *hand[0], *hand[1], force]


@functools.lru_cache(maxsize=256)
def _transition(k, b, time):
    """The two rows that matter of the exponential; the same few times come back in every piece."""
    system = np.zeros((7, 7))
    system[0, 1] = 1.0
    system[1] = -k, -b, k, b, 0.0, 0.0, 1.0
    system[2, 4] = system[3, 5] = 1.0
    return expm(time * system)[:2]
