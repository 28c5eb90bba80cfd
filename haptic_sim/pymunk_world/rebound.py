# SPDX-License-Identifier: Apache-2.0
"""How far the tool may rebound from an impact under its coupling, so that nothing is given at the port.

A step by backward difference, M_e (v⁺ − v) = h f + Gᵀ λ, M_e = M + h B + h² K, with the push f of the coupling before
it and the contact's row G, gives with d = v⁺ − v and the force of the coupling F at its end

    ΔE − h v⁺ · F = λ G v⁺ − ½ dᵀ M d.

A rebound G v⁺ = e u from the approach u = −G v is passive at the port if that is not above 0. Of a tool that does not
turn, with k = f h/(m u) and μ = m_e/m − 1, it asks for e² (½ + μ) + e (k + μ) ≤ ½: e goes to 1 − k for fast impacts
and to 1/2k for slow ones where μ is small. Gravity is no port and gives nothing.
"""

import math


def passive_rebound(approach: float, pushed: float, mobility: float, loss: tuple[float, float, float]) -> float:
    """Largest restitution e with which an impact at this rate of approach u [m/s] gives nothing at the port.

    pushed [m/s]: rate by which the coupling's push alone closes the gap in the step. mobility w [1/kg]: what an impulse
    does to the rate. loss: of the kinetic energy (a₀ − 2 a₁ λ + a₂ λ²)/2 that the step's backward difference has taken
    with an impulse λ = ((1 + e) u + pushed)/w. The port got less than that exactly if λ e u ≤ loss, a quadratic in e.
    """
    at_0, slope, square = (approach + pushed) / mobility, approach / mobility, loss[2]
    a = slope * approach - 0.5 * square * slope**2
    b = at_0 * approach + loss[1] * slope - square * at_0 * slope
    c = -0.5 * loss[0] + loss[1] * at_0 - 0.5 * square * at_0**2
    return (math.sqrt(max(b * b - 4.0 * a * c, 0.0)) - b) / (2.0 * a)
