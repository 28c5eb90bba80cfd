# SPDX-License-Identifier: Apache-2.0
"""Where walls begin to shake in lock-step, against the eigenvalues.

The handle is pressed against the wall by a constant force, without operator, encoder steps or friction.
"""

from typing import Annotated

import typer

from haptic_device.analysis.stability import largest_stable_stiffness
from haptic_device.analysis.zwidth import Operator, Setup
from reference.boundary import CASES, boundary_stiffness


def main(seconds: Annotated[float, typer.Argument(min=0.1, help="Of each run.")] = 10.0) -> None:
    """Where walls begin to shake in lock-step, against the eigenvalues."""
    for mass, physical_damping, damping, period, delay in CASES:
        setup = Setup(mass, physical_damping, period, delay_samples=delay, seconds=seconds)
        exact = largest_stable_stiffness(mass, physical_damping, damping, period, delay)
        found = boundary_stiffness(setup, (Operator(pressed=True),), damping, 1.5 * exact)
        print(
            f"m {mass:g} kg, b {physical_damping:g}, B {damping:g} N s/m, T {period * 1e3:g} ms, delay {delay:g} T: "
            f"lock-step {found:.1f} N/m, eigenvalues {exact:.1f} N/m, {100.0 * (found / exact - 1.0):+.2f} %"
        )
