# SPDX-License-Identifier: Apache-2.0
"""A search over handle paths that draw energy: found at 0.98 of the bound, none at 1.02, with the laws themselves."""

import numpy as np
import pytest
from scipy.linalg import eigh

from adversary.switching import switched_cancellation_damping
from adversary.wall_search import Display, search
from haptic_device.control import velocity_estimator, virtual_wall
from haptic_device.control.damping_compensation import cancellation_fade, cancellation_force
from reference.closed_forms import delayed_wall_damping, lagged_wall_damping, wall_damping


@pytest.mark.parametrize(
    "bound, ticks, display",
    [
        (wall_damping(1.0, 0.0, 1.0), 40, {}),
        (wall_damping(1.0, 0.3, 1.0), 40, {"damping": 0.3}),
        (lagged_wall_damping(1.0, 0.4, 1.0, 0.5), 60, {"damping": 0.4, "lag": 0.5}),
        (delayed_wall_damping(1.0, 0.0, 1.0, 1), 60, {"delay": 1}),
        (delayed_wall_damping(1.0, 0.25, 1.0, 1), 60, {"damping": 0.25, "delay": 1}),
        (switched_cancellation_damping(1.0, 0.0, 1.0, 0.9), 30, {"cancelled": 0.9}),
        (wall_damping(1.0, 0.0, 1.0), 40, {"cancelled": 0.9, "band": 1.0}),
        (wall_damping(1.0, 0.3, 1.0), 40, {"damping": 0.3, "cancelled": 0.9, "band": 1.0}),
        (delayed_wall_damping(1.0, 0.0, 1.0, 1), 60, {"delay": 1, "cancelled": 0.7, "band": 2.0}),
    ],
)
def test_an_optimizer_over_handle_paths_finds_energy_just_below_the_bound_and_none_just_above(bound, ticks, display):
    starts = 16  # below the bound the first that leads to energy is among eight
    assert search(Display(0.98 * float(bound), **display), ticks, starts, enough=1e-3).energy > 1e-3
    assert search(Display(1.02 * float(bound), **display), ticks, starts).energy == 0.0


def lagged_forces(damping, lag, ticks):
    """Force of a wall of K = T = 1 as a matrix over the path, by the servo's own estimator; lag in periods."""
    forces = np.zeros((ticks, ticks))
    for k, path in enumerate(np.eye(ticks)):
        rate, before = 0.0, 0.0
        for j, here in enumerate(path):
            rate = velocity_estimator.velocity_of(rate, here - before, 1.0, lag)
            forces[j, k], before = here + damping * rate, here
    return forces


def worst_lagged_damping(damping, lag, ticks=160):
    """Least b over all paths of so many ticks from rest: the largest eigenvalue of work against Σ Δx²."""
    step = np.diff(np.eye(ticks), axis=0)
    work = -lagged_forces(damping, lag, ticks)[:-1].T @ step
    loss = step.T @ step
    return eigh(0.5 * (work + work.T)[1:, 1:], loss[1:, 1:], subset_by_index=[ticks - 2] * 2)[0][0]


@pytest.mark.parametrize("damping", [0.4, -0.3, 3.0])
@pytest.mark.parametrize("lag", [0.5, 4.0])
def test_the_worst_path_finds_energy_just_below_the_bound_of_a_lagging_velocity_and_none_just_above(damping, lag):
    bound = float(lagged_wall_damping(1.0, damping, 1.0, lag))
    assert 0.98 * bound < worst_lagged_damping(damping, lag) < 1.02 * bound


def drawn(physical_damping, ratio, band, deepest=3.0, cells=16, rounds=300):
    """What each further tick still adds to the energy that can be drawn from wall (K = T = 1) and fading cancellation.

    Value iteration over all paths on a grid whose longest step is 1; the band is measured in it. The grid restricts the
    paths and never invents energy, so what it finds is there. 0: no path draws more.
    """
    position = np.arange(-round((band + 3.0) * cells), round(deepest * cells) + 1) / cells
    step = np.arange(-cells, cells + 1) / cells
    fade = np.array([cancellation_fade(-x, band, 0.0, 1.0) for x in position])
    pushed = np.array([virtual_wall.wall_force(1.0, 0.0, x, 0.0) for x in position])
    force = cancellation_force(ratio * fade[:, None], physical_damping, step[None, :]) - pushed[:, None]
    after = np.arange(position.size)[:, None] + np.arange(-cells, cells + 1)[None, :]
    known = (after >= 0) & (after < position.size)
    gain = force[:, :, None] * step - physical_damping * step**2
    gain = np.where(known[:, None, :], gain, -np.inf)
    value, after = np.zeros((position.size, step.size)), np.clip(after, 0, position.size - 1)
    for _ in range(rounds):
        new = np.maximum(0.0, np.max(gain + value[after, np.arange(step.size)][:, None, :], axis=2))
        added, value = np.max(new - value), new
        if added == 0.0:
            break
    return added


@pytest.mark.parametrize("ratio", [0.5, 0.9, 0.98])
def test_with_a_band_of_one_ticks_travel_cancellation_leaves_the_wall_its_whole_bound(ratio):
    bound = float(wall_damping(1.0, 0.0, 1.0))
    assert drawn(0.98 * bound, ratio, 1.0) > 1e-3
    assert drawn(1.02 * bound, ratio, 1.0) == 0.0


def test_half_a_ticks_travel_is_the_narrowest_band_that_does():
    bound = float(wall_damping(1.0, 0.0, 1.0))
    assert drawn(1.02 * bound, 0.9, 0.5) == 0.0
    assert drawn(1.02 * bound, 0.9, 0.35) > 1e-3
    assert drawn(1.3 * bound, 0.9, 1e-6) > 1e-3
