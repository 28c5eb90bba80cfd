# SPDX-License-Identifier: Apache-2.0
"""The linear rule K < (b + B)/(T/2 + t_d) beside the exact boundary."""

from haptic_device.theory.stability import largest_stable_stiffness

LOOPS = (  # m [kg], b, B [N s/m], T [s], delay [T]: little damping, short delay
    (0.1, 0.5, 0.0, 1e-3, 0.0),
    (0.1, 0.5, 0.25, 1e-3, 0.0),
    (0.1, 0.5, 0.25, 1e-3, 1.0),
    (0.2, 0.5, 1.0, 1e-3, 0.5),
    (1.0, 1.0, 2.0, 1e-3, 2.0),
    (0.8, 2.0, 2.0, 5e-4, 3.0),
)


def boundary() -> list[float]:
    """Exact largest stable stiffness over that of the rule, of each loop."""
    return [
        largest_stable_stiffness(m, b, B, T, delay) / ((b + B) / (0.5 * T + delay * T)) for m, b, B, T, delay in LOOPS
    ]
