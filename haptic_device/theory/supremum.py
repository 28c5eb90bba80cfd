# SPDX-License-Identifier: Apache-2.0
"""The largest value of a smooth function of frequency: a dense grid, then every promising peak refined."""

from collections.abc import Callable, Iterable

import numpy as np

from haptic_device.theory.quantity import Array

GRID = 1024
PEAKS = 8
ZOOM = 33
ROUNDS = 4
LOWEST = 1e-5


def angles(near: Iterable[float] = ()) -> Array:
    """Angles θ = ωT in (0, π]: even, dense towards 0 for slow poles, and around each angle of `near` [rad]."""
    even = np.linspace(0.0, np.pi, GRID + 1)[1:]
    slow = np.geomspace(LOWEST, even[0], 128, endpoint=False)
    spread = np.geomspace(1e-7, 0.1, 128)
    around = [center + sign * spread for center in near for sign in (-1.0, 1.0)]
    grid = np.unique(np.concatenate([slow, even, *around]))
    return grid[(grid >= LOWEST) & (grid <= np.pi)]


def supremum(function: Callable[[Array], Array], near: Iterable[float] = ()) -> tuple[Array, Array]:
    """Largest value of function(θ) over 0 < θ ≤ π and the angle where it is taken.

    `function` gets angles with the grid on the last axis and may broadcast parameters over the axes before it; both
    results lose that last axis. Peaks narrower than π/1024 are found if their angle is in `near`.
    """
    grid = angles(near)
    values = np.atleast_1d(function(grid))
    low, high = _brackets(grid, values)
    for _ in range(ROUNDS):
        fine = low[..., None] + (high - low)[..., None] * np.linspace(0.0, 1.0, ZOOM)
        refined = function(fine.reshape(*fine.shape[:-2], -1)).reshape(fine.shape)
        best = np.argmax(refined, axis=-1)[..., None]
        low = np.take_along_axis(fine, np.maximum(best - 1, 0), -1)[..., 0]
        high = np.take_along_axis(fine, np.minimum(best + 1, ZOOM - 1), -1)[..., 0]
    peaks = np.take_along_axis(refined, best, -1)[..., 0]
    places = np.take_along_axis(fine, best, -1)[..., 0]
    winner = np.argmax(peaks, axis=-1)[..., None]
    return np.take_along_axis(peaks, winner, -1)[..., 0], np.take_along_axis(places, winner, -1)[..., 0]


def _brackets(grid: Array, values: Array) -> tuple[Array, Array]:
    """Neighbours of the highest local maxima on the grid, one pair for each."""
    edge = np.full_like(values[..., :1], -np.inf)
    padded = np.concatenate([edge, values, edge], -1)
    is_peak = (values >= padded[..., :-2]) & (values >= padded[..., 2:])
    top = np.argsort(np.where(is_peak, values, -np.inf), axis=-1)[..., -PEAKS:]
    return grid[np.maximum(top - 1, 0)], grid[np.minimum(top + 1, grid.size - 1)]
