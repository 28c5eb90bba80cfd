# SPDX-License-Identifier: Apache-2.0
"""Operating point: parameter values on a device, made into the record the servo takes."""

import math

import numpy as np

from haptic_device.device import settings_of
from haptic_device.law import cancellation, coupling, encoder, engage, exchange, fault, servo, wall
from haptic_device.runtime.exchange import GAINS

PARAMETERS = (
    *servo.PARAMETERS,
    *coupling.PARAMETERS,
    *wall.PARAMETERS,
    *cancellation.PARAMETERS,
    *encoder.PARAMETERS,
    *engage.PARAMETERS,
    *exchange.PARAMETERS,
    *fault.PARAMETERS,
)
DIRECT = {  # parameter → field of SETTINGS with the same number
    "cancellation.ratio": "cancellation_ratio",
    "cancellation.band": "cancellation_band",
    "cancellation.stretch": "cancellation_stretch",
    "velocity.lag": "velocity_lag",
    "exchange.hold": "exchange_hold",
    "exchange.fade": "exchange_fade",
    "engage.time": "engage_time",
    "engage.force": "engage_force",
    "fault.silence": "silence",
    "fault.saturation": "saturation",
}


def settings_from(device, values, version=0):
    """SETTINGS record of this operating point. Raises ValueError, one sentence, where values do not fit together."""
    settings = settings_of(device)
    settings["version"], settings["period"] = version, 1.0 / values["servo.rate"]
    for name, field in DIRECT.items():
        settings[field] = values[name]
    for name, field in (("stiffness", "stiffness"), ("damping", "damping")):
        settings[field][0, :2] = values[f"coupling.{name}"]
        settings[field][0, 2] = values[f"coupling.rotational_{name}"]
    settings["force_limit"][0] = (values["force.limit"], values["force.limit"], values["force.limit_rotational"])
    _set_walls(settings, values)
    return settings


def _set_walls(settings, values):
    offsets, normals = values["wall.offsets"], values["wall.normals"]
    count = len(offsets)
    if count > wall.MOST:
        raise ValueError(f"wall.offsets names {count} walls; the limit is {wall.MOST}")
    for name, per_wall in (("wall.normals", 2), ("wall.stiffness", 1), ("wall.damping", 1)):
        if len(values[name]) != per_wall * count:
            raise ValueError(f"{name} has {len(values[name])} numbers; {count} walls need {per_wall * count}")
    settings["walls"] = count
    for i in range(count):
        nx, ny = normals[2 * i : 2 * i + 2]
        length = math.hypot(nx, ny)
        if abs(length - 1.0) > 1e-3:
            raise ValueError(f"wall.normals of wall {i} is [{nx:g}, {ny:g}], of length {length:g}; write a unit vector")
        settings["wall_x"][0, i], settings["wall_y"][0, i] = nx / length, ny / length
        settings["wall_offset"][0, i] = offsets[i]
        settings["wall_stiffness"][0, i], settings["wall_damping"][0, i] = (
            values["wall.stiffness"][i],
            values["wall.damping"][i],
        )


def gains_from(values):
    """GAINS record of the coupling, as the exchange ships them."""
    gains = np.zeros(1, GAINS)
    names = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    numbers = [values[f"coupling.{name}"] for name in names]
    for name, number in zip(names, numbers, strict=True):
        gains[name] = number
    gains["hash"] = exchange.gains_hash(*numbers)
    return gains
