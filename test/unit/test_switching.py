# SPDX-License-Identifier: Apache-2.0
"""Damping cancelled outside a wall only: a leak just below the threshold, none just above."""

import numpy as np
import pytest

from adversary.switching import switched_cancellation_damping
from reference.closed_forms import wall_damping


def energy_given(path, damping, physical_damping, cancelled):
    """Energy a wall of K = T = 1 with cancellation outside (x ≤ 0) gives along a path at constant speeds.

    A nanometre of a metre's path is taken as outside, for rounding.
    """
    given, last = 0.0, path[0]
    for here, after in zip(path[:-1], path[1:], strict=True):
        inside = here > 1e-9
        force = -here - damping * (here - last) if inside else cancelled * physical_damping * (here - last)
        given += force * (after - here) - physical_damping * (after - here) ** 2
        last = here
    return given


def round_trips(cancelled, glide=60, trips=40):
    """Out of the wall by one step, far out on a dying glide, a rest, and the same way back in."""
    shrink = (1.0 - np.sqrt(1.0 - cancelled**2)) / cancelled
    out = shrink ** np.arange(1, glide)
    slow_return = np.full(4000, (np.sum(out) - np.sum(out[::-1])) / 4000)
    once = np.concatenate([[-1.0], -out, slow_return, out[::-1], [1.0]])
    return 1.0 + np.cumsum(np.concatenate([[0.0], np.tile(once, trips)]))


def leaks(physical_damping, damping, cancelled, angles=240):
    """Whether energy can be drawn without end, by value iteration over the directions of (position, last step).

    Scaling a path scales its energy by the square, so only the direction of the state counts; the step from position x
    to direction φ has the length x/(cos φ − sin φ). The grid restricts the paths and never invents energy.
    """
    direction = np.concatenate(
        [np.linspace(-np.pi, np.pi, angles, endpoint=False) + 1e-4, np.pi / 2 + np.array([-1e-9, 1e-9])]
    )
    position, last = np.cos(direction), np.sin(direction)
    length = position[:, None] / (position - last)[None, :]
    step = length * last[None, :]
    force = np.where(position > 0.0, position + damping * last, -cancelled * physical_damping * last)[:, None]
    gain = np.where(length > 0.0, -physical_damping * step**2 - force * step, -np.inf)
    growth, stored = np.where(length > 0.0, length**2, 0.0), np.zeros(position.size)
    for _ in range(1500):
        after = np.maximum(0.0, np.max(gain + growth * stored, axis=1))
        if np.max(after) > 1e4 or np.max(after - stored) < 1e-9:
            break
        stored = after
    return np.max(after) > 1e4


@pytest.mark.parametrize(
    "cancelled, expected", [(0.0, 0.5), (0.25, 0.5081), (0.5, 0.5359), (0.75, 0.6019), (0.9, 0.6964), (1.0, 1.0)]
)
def test_the_switch_costs_more_the_more_is_cancelled(cancelled, expected):
    assert switched_cancellation_damping(1.0, 0.0, 1.0, cancelled) == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("cancelled", [0.5, 0.9])
@pytest.mark.parametrize("damping", [0.0, 0.1, 0.3])
def test_round_trips_through_the_switch_give_energy_just_below_the_threshold_and_none_just_above(cancelled, damping):
    threshold = (1.0 + damping) / (1.0 + np.sqrt(1.0 - cancelled**2))
    path = round_trips(cancelled)
    assert energy_given(path, damping, 0.99 * threshold, cancelled) > 0.2
    assert energy_given(path, damping, 1.01 * threshold, cancelled) < 0.0


@pytest.mark.parametrize("damping, cancelled", [(0.0, 0.5), (0.0, 0.9), (0.3, 0.5), (0.3, 0.9)])
def test_search_over_all_paths_leaks_somewhat_below_the_threshold_and_never_above(damping, cancelled):
    threshold = switched_cancellation_damping(1.0, damping, 1.0, cancelled)
    assert leaks(0.93 * threshold, damping, cancelled)
    assert not leaks(1.002 * threshold, damping, cancelled)


def test_nothing_cancelled_is_the_wall_alone_and_all_cancelled_needs_the_whole_spring():
    assert switched_cancellation_damping(800.0, 0.1, 1e-3, 0.0) == pytest.approx(wall_damping(800.0, 0.1, 1e-3))
    assert switched_cancellation_damping(800.0, 0.1, 1e-3, 1.0) == pytest.approx(0.9)


def test_more_than_all_damping_is_not_cancelled():
    with pytest.raises(ValueError, match="cancelled is 1.2, but it must lie between 0 and 1"):
        switched_cancellation_damping(1.0, 0.0, 1.0, 1.2)
