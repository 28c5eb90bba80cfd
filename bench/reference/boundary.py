# SPDX-License-Identifier: Apache-2.0
"""Where a wall begins to shake in lock-step, and the walls that this is compared with the eigenvalues of."""

from haptic_device.theory.zwidth import SHAKING, run_cells

CASES = (  # m [kg], b [N s/m], B [N s/m], T [s], delay [T]
    (0.1, 0.5, 0.0, 1e-3, 0.0),
    (0.1, 0.5, -0.2, 1e-3, 0.0),
    (0.1, 0.5, 5.0, 1e-3, 0.0),
    (0.05, 2.0, 1.0, 1e-3, 1.0),
    (0.3, 1.0, 0.5, 1e-3, 2.0),
    (0.1, 0.5, 0.25, 1e-3, 0.5),
    (0.1, 3.0, 0.5, 2.5e-4, 0.0),
    (0.1, 0.8, 0.2, 2.5e-4, 1.3),
    (0.1, 3.0, 1.0, 1e-4, 0.0),
)


def boundary_stiffness(setup, operators, damping, high, precision=1e-3):
    """Largest K [N/m] below which no wall of this B shakes with these operators, by bisection below `high`.

    Stops at this relative precision; `high` itself if nothing shakes there.
    """
    low = 0.0
    if run_cells(setup, operators, high, damping).assessment < SHAKING:
        return high
    while high - low > precision * high:
        middle = 0.5 * (low + high)
        shakes = run_cells(setup, operators, middle, damping).assessment == SHAKING
        low, high = (low, middle) if shakes else (middle, high)
    return 0.5 * (low + high)
