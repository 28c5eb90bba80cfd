# SPDX-License-Identifier: Apache-2.0
"""Closed forms of the least physical damping b of a wall or coupling, where condition (1) has one.

Written out here a second time, so that control/passivity and the search of theory/passivity have something to be
compared with.
K stiffness [N/m], B damping [N s/m], T period [s]; every function takes arrays and broadcasts.
"""

import numpy as np
from numpy.polynomial import chebyshev

from haptic_device.theory.quantity import not_negative, positive, within


def wall_damping(stiffness, damping, period):
    """b > KT/2 + |B|, B of either sign (Colgate, Stanley & Brown 1995, eq. 3) [N s/m]."""
    return stiffness * period / 2.0 + np.abs(damping)


def lagged_wall_damping(stiffness, damping, period, velocity_lag):
    """Velocity through a first-order lag τ (backward Euler): KT/2 + B T/(T+2τ) for B > 0, KT/2 + |B| for B < 0.

    A positive B is dangerous where the sign alternates, and there the lag weakens it; a negative B is dangerous at
    rest, where the lag does nothing.
    """
    weakened = damping * period / (period + 2.0 * velocity_lag)
    return stiffness * period / 2.0 + np.where(np.asarray(damping) > 0.0, weakened, np.abs(damping))


@np.vectorize
def delayed_wall_damping(stiffness, damping, period, delay_samples):
    """N whole samples late: sup over θ of (KT/2) sin((2N+1)θ/2)/sin(θ/2) − B cos((N+1)θ) [N s/m].

    The first factor is 1 + 2 Σ cos kθ, k = 1…N, so the right-hand side is a Chebyshev series in cos θ whose largest
    value lies at an end or at a root of its derivative.
    """
    series = np.full(int(delay_samples) + 2, float(stiffness * period))
    series[0], series[-1] = stiffness * period / 2.0, -damping
    turning = chebyshev.chebroots(chebyshev.chebder(chebyshev.chebtrim(series, 1e-16 * np.max(np.abs(series)))))
    inside = turning[np.abs(turning) <= 1.0].real
    return np.max(chebyshev.chebval(np.concatenate([inside, [-1.0, 1.0]]), series))


def fractionally_delayed_spring_damping(stiffness, period, delay_samples):
    """A spring alone, N + s samples late (0 ≤ s < 1): ½ [A + √(A² + s(1−s)(KT)²)], A = KT (½ + N + s) [N s/m]."""
    not_negative("delay_samples", delay_samples, "samples")
    fraction = np.mod(delay_samples, 1.0)
    straight = 0.5 + np.asarray(delay_samples)
    return stiffness * period * 0.5 * (straight + np.sqrt(straight**2 + fraction * (1.0 - fraction)))


def late_write_damping(stiffness, damping, period, lateness):
    """Samples on time, forces written late by anything in [0, lateness ≤ T/2], in any order: enough damping [N s/m].

    The spring's share is exact: at each tick the leak grows with the lateness up to T/2, so the worst sequence is the
    constant one. The damper acts over holds of up to T + lateness: |B v_k Δy_k| ≤ (|B|/2)(a T v_k² + Δy_k²/(aT)),
    summed with the best a, costs |B| √(1 + lateness/T).
    """
    within("lateness", lateness, 0.0, np.min(period) / 2.0, "s")
    late = np.asarray(lateness) / period
    return fractionally_delayed_spring_damping(stiffness, period, late) + np.abs(damping) * np.sqrt(1.0 + late)


def late_tick_damping(stiffness, damping, period, longest_period):
    """Sample and force late together: the longest period counts, b > (K/2 + |B|/T) T_longest [N s/m].

    The velocity is the difference over the nominal period T; dividing by the period that really passed is not safer,
    for a short tick's estimate may be held over a long one.
    """
    positive("longest_period", longest_period, "s")
    return (stiffness / 2.0 + np.abs(damping) / period) * longest_period


def wall_damping_for_any_simulation(stiffness, damping, period):
    """Eq. 5 with eq. 2, in step [N s/m]: KT/2 + B for B ≥ 0, (KT/2)²/(KT/2 + B) for −KT/2 < B < 0, else infinite."""
    half = np.asarray(stiffness) * period / 2.0
    total = half + damping
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.asarray(damping) >= 0.0, total, np.where(total > 0.0, half**2 / total, np.inf))[()]
