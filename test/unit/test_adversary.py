# SPDX-License-Identifier: Apache-2.0
"""A search over handle paths that draw energy: found at 0.98 of the bound, none at 1.02, with the laws themselves."""

import numpy as np
import pytest

from adversary.switching import switched_cancellation_damping
from adversary.wall_search import Display, search
from bench.reference.closed_forms import delayed_wall_damping, lagged_wall_damping, wall_damping


@pytest.mark.parametrize(
    "bound, ticks, display",
    [
        (wall_damping(1.0, 0.3, 1.0), 40, {"damping": 0.3}),
        (lagged_wall_damping(1.0, 0.4, 1.0, 0.5), 60, {"damping": 0.4, "lag": 0.5}),
        (delayed_wall_damping(1.0, 0.25, 1.0, 1), 60, {"damping": 0.25, "delay": 1}),
        (switched_cancellation_damping(1.0, 0.0, 1.0, 0.9), 30, {"cancelled": 0.9}),
        (wall_damping(1.0, 0.3, 1.0), 40, {"damping": 0.3, "cancelled": 0.9, "band": 1.0}),
        (delayed_wall_damping(1.0, 0.0, 1.0, 1), 60, {"delay": 1, "cancelled": 0.7, "band": 2.0}),
    ],
)
def test_an_optimizer_over_handle_paths_finds_energy_just_below_the_bound_and_none_just_above(bound, ticks, display):
    starts = 8  # below the bound the first that leads to energy is among eight
    assert search(Display(0.98 * float(bound), **display), ticks, starts, enough=1e-3).energy > 1e-3
    assert search(Display(1.02 * float(bound), **display), ticks, starts).energy == 0.0


def round_trips_give(physical_damping, damping, cancelled, glide=60, trips=40):
    """Energy that a wall of K = T = 1 with cancellation outside (x ≤ 0) gives along round trips through its surface:
    out by one step, far out on a dying glide, a rest, and the same way back in, at constant speeds."""
    shrink = (1.0 - np.sqrt(1.0 - cancelled**2)) / cancelled
    out = shrink ** np.arange(1, glide)
    slow_return = np.full(4000, (np.sum(out) - np.sum(out[::-1])) / 4000)
    once = np.concatenate([[-1.0], -out, slow_return, out[::-1], [1.0]])
    path = 1.0 + np.cumsum(np.concatenate([[0.0], np.tile(once, trips)]))
    rate, moved = np.diff(path[:-1], prepend=path[0]), np.diff(path)
    inside = path[:-1] > 1e-9  # for rounding
    force = np.where(inside, -path[:-1] - damping * rate, cancelled * physical_damping * rate)
    return force @ moved - physical_damping * moved @ moved


@pytest.mark.parametrize("damping, cancelled", [(0.0, 0.5), (0.1, 0.9), (0.3, 0.9)])
def test_round_trips_through_a_switch_give_energy_just_below_its_threshold_and_none_just_above(damping, cancelled):
    """Damping cancelled outside a wall only; nothing cancelled is the wall alone, all cancelled the whole spring."""
    threshold = switched_cancellation_damping(1.0, damping, 1.0, cancelled)
    assert round_trips_give(0.99 * threshold, damping, cancelled) > 0.2
    assert round_trips_give(1.01 * threshold, damping, cancelled) < 0.0
    assert switched_cancellation_damping(800.0, 0.1, 1e-3, 0.0) == pytest.approx(wall_damping(800.0, 0.1, 1e-3))
    assert switched_cancellation_damping(800.0, 0.1, 1e-3, 1.0) == pytest.approx(0.9)
