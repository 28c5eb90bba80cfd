# SPDX-License-Identifier: Apache-2.0
"""Lock-step systems that several tests start from."""

import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import NODES
from haptic_sim.lockstep.lockstep import Lockstep


def values(node, **given):
    """All parameter values of a node: the defaults, and what is given with `__` for a dot."""
    return defaults(NODES[node]) | {name.replace("__", "."): value for name, value in given.items()}


def device(damping=1.0, counts=1e7, coulomb=0.0, axes=2, **changes):
    """The desktop device with other figures in x and y, and as many axes."""
    shipped = load_device("desktop")
    figures = {"damping": damping, "counts_per_unit": counts, "coulomb": coulomb, "velocity_limit": 10.0}
    plane = [axis.model_copy(update=figures) for axis in shipped.axes[:2]]
    return shipped.model_copy(update={"axes": (*plane, shipped.axes[2])[:axes], **changes})


def wall_system(
    stiffness, damping, angle=90.0, motion="tap", physical_damping=1.0, counts=1e7, loopback=None, axes=2, **driver
):
    """A handle that the hand moves from 10 mm before to 10 mm in one wall of this normal angle [°]; no tool."""
    normal = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    walls = {
        "wall__normals": tuple(normal[:2]),
        "wall__offsets": (0.0,),
        "wall__stiffness": (stiffness,),
        "wall__damping": (damping,),
        "coupling__stiffness": 0.0,
        "coupling__damping": 0.0,
        "engage__time": 0.05,
    }
    hand = {
        "motion__name": motion,
        "motion__start": tuple(0.01 * normal),
        "motion__target": tuple(-0.01 * normal),
        "motion__duration": 1.0,
    }
    return Lockstep(
        device(physical_damping, counts, axes=axes),
        values("haptic_driver", **walls | driver),
        values("haptic_loopback", **hand | (loopback or {})),
        None,
    )
