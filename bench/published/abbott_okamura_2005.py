# SPDX-License-Identifier: Apache-2.0
"""The two ways in which an encoder's step and the sampling make a spring give energy; K = T = Δ = 1."""

import numpy as np

from bench.reference.bisection import bisected
from haptic_device.control import velocity_estimator, virtual_wall

BRACKET, HALVINGS = (0.3, 0.7), 8
ROUNDS, LEAST = 400, 1e-9


def damping() -> list[float]:
    """Least b [KT] with f_c = KΔ/2: steps of up to 40 Δ in a wall 60 Δ deep."""
    return [_least(lambda b: _drawn(b, 0.5, longest=40, cells=4, deepest=60))]


def friction() -> list[float]:
    """Least f_c [KΔ] with b = KT/2: steps of up to 3 Δ on a grid of 1/50 Δ."""
    return [_least(lambda coulomb: _drawn(0.5, coulomb, longest=3, cells=50, deepest=8))]


def _least(drawn):
    """The value above which no path draws energy."""
    return bisected(lambda value: drawn(value) <= LEAST, *BRACKET, HALVINGS)


def _drawn(physical_damping, coulomb, longest, cells, deepest):
    """Most energy [K Δ²] that any path on the grid draws from the wall, from rest at its surface: value iteration.

    In a tick the handle goes straight, and the force of the tick's reading is held. longest: step, deepest: depth [Δ].
    """
    position = np.arange(-2 * cells, deepest * cells + 1) / cells
    force = np.array([-virtual_wall.wall_force(1.0, 0.0, _read(x), 0.0) for x in position])
    step = np.arange(-longest * cells, longest * cells + 1) / cells
    after = np.arange(position.size)[:, None] + np.arange(-longest * cells, longest * cells + 1)
    gain = force[:, None] * step - physical_damping * step**2 - coulomb * np.abs(step)
    gain = np.where((after >= 0) & (after < position.size), gain, -np.inf)
    value, after = np.zeros(position.size), np.clip(after, 0, position.size - 1)
    for _ in range(ROUNDS):
        value, before = np.maximum(0.0, (gain + value[after]).max(axis=1)), value
        if np.array_equal(value, before):
            break
    return float(value[2 * cells])


def _read(position):
    return velocity_estimator.position_of(np.floor(position + 0.5), 1.0, 0.0)
