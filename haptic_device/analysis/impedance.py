# SPDX-License-Identifier: Apache-2.0
"""The impedance that a display shows, fitted to a recording: mass, damping, stiffness, each with its confidence.

f = m a + b v + k x + c, by least squares; f: force that has to push against it, c: one constant for each contact.
Forces of a servo are no independent draws, neighbours err alike. So the confidence is computed from the sums of
stretches of time (a cluster-robust covariance; Liang & Zeger 1986) and Student's t with as many degrees of freedom.
"""

from typing import NamedTuple

import numpy as np
from scipy import stats

CLUSTERS = 24  # stretches of time
LEAST = 100  # samples below which nothing is fitted
CONFIDENCE = 0.95


class Estimate(NamedTuple):
    """A value and the half width of its 95 % confidence interval."""

    value: float
    error: float


class Impedance(NamedTuple):
    """Mass [kg | kg m²], damping [N s/m | N m s/rad], stiffness [N/m | N m/rad]; r² and samples of the fit."""

    mass: Estimate
    damping: Estimate
    stiffness: Estimate
    explained: float
    samples: int


def fit(time, position, velocity, force, groups=None) -> Impedance | None:
    """Fits one axis; times [s] increasing, groups: number of the contact of each sample (their own constant c).

    None where there are too few samples, or the axis hardly moved. Samples that are not finite are left out.
    """
    acceleration = _derivative(time, velocity, groups)
    finite = np.isfinite(acceleration) & np.isfinite(position) & np.isfinite(velocity) & np.isfinite(force)
    if finite.sum() < LEAST:
        return None
    groups = np.zeros(len(time), int) if groups is None else groups
    columns = np.stack([acceleration, velocity, position], axis=1)[finite]
    columns = _centred(columns, groups[finite])
    target = _centred(np.asarray(force, float)[finite, None], groups[finite])[:, 0]
    scale = columns.std(axis=0)
    if (scale <= 0.0).any() or target.std() <= 0.0:
        return None
    return _estimates(columns / scale, target, scale)


def _derivative(time, values, groups):
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


def _centred(columns, groups):
    """Columns less their mean in each group: the constants c are fitted by that."""
    _, index = np.unique(groups, return_inverse=True)
    counts = np.bincount(index)[:, None]
    means = np.stack([np.bincount(index, column) for column in columns.T], axis=1) / counts
    return columns - means[index]


def _estimates(columns, target, scale):
    inverse = np.linalg.pinv(columns.T @ columns)
    solution = inverse @ (columns.T @ target)
    rest = target - columns @ solution
    scores = np.array_split(columns * rest[:, None], CLUSTERS)
    sums = np.array([part.sum(axis=0) for part in scores])
    covariance = inverse @ (sums.T @ sums) @ inverse * CLUSTERS / (CLUSTERS - 1)
    width = stats.t.ppf(0.5 + CONFIDENCE / 2, CLUSTERS - 1) * np.sqrt(np.diag(covariance))
    estimates = (Estimate(float(v), float(e)) for v, e in zip(solution / scale, width / scale, strict=True))
    return Impedance(*estimates, float(1.0 - rest.var() / target.var()), len(target))
