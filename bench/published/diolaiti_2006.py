# SPDX-License-Identifier: Apache-2.0
"""A device with little damping and some Coulomb friction is calmer than passivity asks it to be."""

import numpy as np

from bench.published.at_rest import stiffest
from haptic_device.config.description import load_device
from haptic_device.theory.delay import largest_passive_stiffness
from haptic_device.theory.zwidth import Setup

PERIOD = 1e-3
"""s."""
STIFFNESS = np.geomspace(10.0, 1e5, 121)


def stable() -> dict[str, float]:
    """Stiffest wall [N/m] of the shipped device without dampers that a light hand comes to rest against; 2b/T."""
    axis = load_device("undamped").axes[0]
    setup = Setup(axis.mass, axis.damping, PERIOD, axis.coulomb, 1.0 / axis.counts_per_unit)
    passive = largest_passive_stiffness(axis.damping, 0.0, PERIOD)
    return {"comes to rest": float(stiffest(setup, STIFFNESS, np.zeros(1))[0]), "passive": float(passive)}
