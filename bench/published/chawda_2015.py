# SPDX-License-Identifier: Apache-2.0
"""The cut-off frequency of the velocity filter that gives the widest range of walls lies in the middle."""

import numpy as np

from bench.published.at_rest import stiffest
from haptic_device.theory.zwidth import Setup

HANDLE = Setup(mass=0.1, physical_damping=0.5, period=2e-4, coulomb=0.1, resolution=2e-5, seconds=0.5)
STIFFNESS, DAMPING = np.geomspace(300.0, 6e4, 30), np.linspace(0.0, 30.0, 16)


def low() -> dict[str, float]:
    """Area [N²s/m²] of the walls that come to rest, of the middle cut-off frequency and of a low one."""
    return {"200 Hz": _width(200.0), "5 Hz": _width(5.0)}


def none() -> dict[str, float]:
    """The same of the middle cut-off frequency and without a filter."""
    return {"200 Hz": _width(200.0), "no filter": _width(np.inf)}


def _width(cutoff):
    setup = HANDLE._replace(velocity_lag=1.0 / (2.0 * np.pi * cutoff))
    return float(np.trapezoid(stiffest(setup, STIFFNESS, DAMPING), DAMPING))
