# SPDX-License-Identifier: Apache-2.0
"""Energy of a wall over a finite horizon with any timing: the exact worst handle path by one eigenvalue problem.

Between two instants the physical damper takes at least b Δx²/Δt, and a held force f gives f Δx. Over given instants of
sampling and of writing, the energy given is at most path · (W − b D) · path, a quadratic form in the positions at those
instants; the display gives nothing over this horizon iff b is at least the largest generalized eigenvalue of (W, D),
and the eigenvector is the path that finds the leak. Longer horizons need more, up to the frequency conditions.

With a simulation behind a coupling its positions are moved at will too, and what it takes counts as given.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from haptic_device.theory.quantity import positive


class WorstPath(NamedTuple):
    """Least physical damping over the horizon [N s/m], and the handle path that needs it."""

    damping: float
    times: np.ndarray
    positions: np.ndarray


def least_damping_over_horizon(stiffness, damping, period, sample_times, write_times):
    """Least damping for a bilateral wall u_k = K x_k + B (x_k − x_{k−1})/T from rest, sampled and written when told.

    Force k answers the position at sample_times[k] and is held from write_times[k] to write_times[k+1]; times in
    seconds, rising, no write before its sample. B is divided by the nominal period. Refuses a period ≤ 0 and times out
    of order.
    """
    positive("period", period, "s")
    sample_times, write_times = np.asarray(sample_times, float), np.asarray(write_times, float)
    _refuse_disorder(sample_times, write_times)
    times = np.unique(np.concatenate([sample_times, write_times]))
    given = _energy_given(stiffness, damping / period, times, sample_times, write_times)
    values, paths = eigh(given, _dissipation(times), subset_by_index=[times.size - 2] * 2)
    return WorstPath(values[-1], times, np.concatenate([[0.0], paths[:, -1]]))


def energy_generated_over_horizon(stiffness, damping, physical_damping, period, write_times):
    """Most energy that display and coupling give to handle and simulation together, per square of their path [J/m²].

    The coupling u_k = K e_k + B (e_k − e_{k−1})/T, e the handle less the simulation, is sampled at k T, from rest; −u_k
    acts on the handle from write_times[k] to the next. The simulation is in step: it takes u_k (y_k − y_{k−1}).
    Arguments and errors as for least_damping_over_horizon, B of either sign.
    """
    positive("period", period, "s")
    write_times = np.asarray(write_times, float)
    sample_times = period * np.arange(write_times.size)
    _refuse_disorder(sample_times, write_times)
    times = np.unique(np.concatenate([sample_times, write_times]))
    handle = np.eye(times.size + sample_times.size)
    simulation, handle = handle[times.size :], handle[: times.size]
    stretch = handle[np.searchsorted(times, sample_times)] - simulation
    force = stiffness * stretch
    force[1:] += damping / period * np.diff(stretch, axis=0)
    work = force[1:].T @ np.diff(simulation, axis=0)
    work -= force[:-1].T @ np.diff(handle[np.searchsorted(times, write_times)], axis=0)
    free = np.delete(np.arange(len(work)), [0, times.size])  # both begin at 0
    work = 0.5 * (work + work.T)[np.ix_(free, free)]
    moved = times.size - 1
    work[:moved, :moved] -= physical_damping * _dissipation(times)
    return eigh(work, eigvals_only=True, subset_by_index=[len(work) - 1] * 2)[0]


def _dissipation(times):
    """Σ Δx²/Δt as a matrix over the positions after the first, which is 0."""
    steps = 1.0 / np.diff(times)
    matrix = np.diag(steps + np.append(steps[1:], 0.0)) - np.diag(steps[1:], 1) - np.diag(steps[1:], -1)
    return matrix


def _energy_given(stiffness, viscous, times, sample_times, write_times):
    """−Σ u_k Δy_k, symmetric, over the positions after the first: u pushes against positive positions."""
    at_sample, at_write = np.searchsorted(times, sample_times), np.searchsorted(times, write_times)
    unit = np.eye(times.size)
    position, written = unit[at_sample], unit[at_write]
    force = stiffness * position
    force[1:] += viscous * np.diff(position, axis=0)
    work = -force[:-1].T @ np.diff(written, axis=0)
    return (0.5 * (work + work.T))[1:, 1:]


def _refuse_disorder(sample_times, write_times):
    if np.any(np.diff(sample_times) <= 0) or np.any(np.diff(write_times) <= 0) or np.any(write_times < sample_times):
        raise ValueError("sample and write times must rise, and no force may be written before its sample")
