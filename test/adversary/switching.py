# SPDX-License-Identifier: Apache-2.0
"""What the switch costs when damping is cancelled outside a wall only: the exact threshold of the physical damping.

Outside (x ≤ 0) the force on the device is −ρ b v̂, inside K x + B v̂, with v̂ the backward difference and B ≥ 0. Write
T = 1, Δ for the displacements and p = (1 − √(1 − ρ²))/2, so that p (1 − p) = ρ²/4.

* Outside, a chain −b Σ Δ_i² + ρ b Σ Δ_i Δ_{i+1} that follows a last step Δ yields at most p b Δ², and one that ends
  in a step D at most −(1 − p) b D². An excursion leaves with Δ_s < 0 and returns with D > 0; where the sign changes
  the product helps nobody, so it yields at most p b Δ_s² − (1 − p) b D², and long ones come as close as you like.
* Inside, after entering by D to x₁ ≤ D, a run that ends with the step Δ_s yields at most
  ½K D² − (b − K/2) Σ Δ_k² − B Σ Δ_k Δ_{k+1}.

Summed, nothing is given iff a tridiagonal form with ends (1 − p) b − K/2, middle b − K/2 and neighbours B/2 is positive
semidefinite for runs of every length: one sample inside asks (1 − p) b ≥ (K + B)/2, long runs ask b ≥ K/2 + B, and
both together suffice because the form is then diagonally dominant. Hence, exactly,

    b ≥ max( KT/2 + B,  (KT + B)/(1 + √(1 − ρ²)) ).

ρ = 0 is the wall alone; full cancellation needs KT + B and is never better than borderline outside.
"""

import numpy as np

from haptic_device.theory.quantity import not_negative, positive, within


def switched_cancellation_damping(stiffness, damping, period, cancelled):
    """Least physical damping when a share ρ = `cancelled` of it is cancelled outside the wall only [N s/m].

    K [N/m], B [N s/m], T [s], all ≥ 0 (T > 0), 0 ≤ ρ ≤ 1; arrays broadcast.
    """
    not_negative("stiffness", stiffness, "N/m")
    not_negative("damping", damping, "N s/m")
    positive("period", period, "s")
    within("cancelled", cancelled, 0.0, 1.0, "")
    spring = np.asarray(stiffness) * period
    return np.maximum(spring / 2.0 + damping, (spring + damping) / (1.0 + np.sqrt(1.0 - np.square(cancelled))))
