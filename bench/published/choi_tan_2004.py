# SPDX-License-Identifier: Apache-2.0
"""How much stiffer a wall may be before it buzzes when the sampling rate rises 160 times."""

import numpy as np

from bench.published.at_rest import stiffest
from haptic_device.theory.zwidth import Setup

HANDLE = Setup(mass=0.075, physical_damping=0.005, period=1e-3, coulomb=0.04, resolution=3e-5)
RATES = 40e3, 250.0
"""Hz."""
STIFFNESS = np.geomspace(100.0, 1e5, 121)


def rise() -> list[float]:
    """Stiffest wall against which a light hand comes to rest at 40 kHz, over that at 250 Hz."""
    fast, slow = map(_clean, RATES)
    return [fast / slow]


def _clean(rate):
    """Stiffest wall [N/m] against which a light hand comes to rest at this rate [Hz]."""
    return float(stiffest(HANDLE._replace(period=1.0 / rate), STIFFNESS, np.zeros(1))[0])
