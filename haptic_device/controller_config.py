# SPDX-License-Identifier: Apache-2.0
"""Operating point: parameter values on a device, made into the record the servo takes."""

import math

import numpy as np

from haptic_device import gain_check
from haptic_device.control import exchange_samples, servo
from haptic_device.control.exchange_samples import COUPLING_GAINS
from haptic_device.parameters import ESTIMATORS, EXCHANGE_METHODS, MOST_WALLS, SOURCES

ARM = 0.05  # [m] between grip and tip, which turns accelerations into angular ones
DIRECT = {  # parameter → field of SETTINGS with the same number
    "cancellation.ratio": "cancellation_ratio",
    "cancellation.band": "cancellation_band",
    "cancellation.stretch": "cancellation_stretch",
    "cancellation.twist": "cancellation_twist",
    "cancellation.filter": "cancellation_filter",
    "velocity.lag": "velocity_lag",
    "velocity.window": "velocity_window",
    "passivity.control": "passivity_control",
    "passivity.budget": "passivity_budget",
    "exchange.hold": "exchange_hold",
    "exchange.fade": "exchange_fade",
    "exchange.budget": "exchange_budget",
    "exchange.tank": "exchange_tank",
    "exchange.horizon": "exchange_horizon",
    "local.compliance": "local_compliance",
    "local.apart": "local_apart",
    "local.hold": "local_hold",
    "local.rejoin": "local_rejoin",
    "engage.time": "engage_time",
    "engage.force": "engage_force",
    "engage.torque": "engage_torque",
    "fault.silence": "silence",
    "fault.saturation": "saturation",
    "fault.duty": "duty",
    "fault.unattended": "unattended",
}


def settings_of(device):
    """SETTINGS record of the servo with what the device description says; gains and limits are still to be set."""
    settings = np.zeros(1, servo.SETTINGS)
    settings["axes"] = len(device.axes)
    scale = (device.scale[0], device.scale[0], device.scale[1])
    for i in range(servo.AXES):
        settings["scale"][0, i] = scale[i]
    for i, axis in enumerate(device.axes):
        settings["position_per_count"][0, i] = axis.encoder_sign / axis.counts_per_unit
        settings["zero"][0, i] = -axis.zero
        settings["motor_per_force"][0, i] = axis.motor_sign / axis.motor_constant
        settings["device_limit"][0, i] = axis.motor_limit
        settings["gravity"][0, i] = -device.weight(i) if device.gravity_compensation else 0.0
        settings["physical_damping"][0, i] = axis.damping
        settings["position_low"][0, i], settings["position_high"][0, i] = axis.workspace
        settings["velocity_limit"][0, i] = axis.velocity_limit
    return settings


def settings_from(device, values, version=0):
    """SETTINGS record of this operating point. Raises ValueError, one sentence, where values do not fit together."""
    settings = settings_of(device)
    settings["version"], settings["period"] = version, 1.0 / values["servo.rate"]
    for name, field in DIRECT.items():
        settings[field] = values[name]
    settings["velocity_estimator"] = ESTIMATORS.index(values["velocity.estimator"])
    settings["cancellation_source"] = SOURCES.index(values["cancellation.source"])
    for name, field in (("stiffness", "stiffness"), ("damping", "damping")):
        settings[field][0, :2] = values[f"coupling.{name}"]
        settings[field][0, 2] = values[f"coupling.rotational_{name}"]
    settings["duty_kept"] = math.exp(-1.0 / (values["servo.rate"] * values["fault.duty_time"]))
    settings["force_limit"][0] = (values["force.limit"], values["force.limit"], values["force.limit_rotational"])
    _set_walls(settings, values)
    _set_exchange(settings, values)
    settings["margin"][0], settings["cross"] = gain_check.margins(settings[0], 0.0)[0], gain_check.cross(settings[0])
    return settings


def _set_exchange(settings, values):
    """Settings of the exchange that follow from others."""
    settings["exchange_method"] = EXCHANGE_METHODS.index(values["exchange.method"])
    settings["exchange_play"] = max(2.0 / values["servo.rate"], 1.0 / values["exchange.rate"])
    held = settings["device_limit"] - np.abs(settings["gravity"])
    settings["coupling_limit"] = np.maximum(0.0, np.minimum(settings["force_limit"], held / settings["scale"]))
    ratio = values["force.limit_rotational"] / values["force.limit"] if values["force.limit"] > 0.0 else 1.0
    settings["exchange_slew"][0] = values["exchange.slew"] * np.array([1.0, 1.0, ratio])
    settings["exchange_agility"][0] = values["exchange.agility"] * np.array([1.0, 1.0, 1.0 / ARM])
    settings["surplus"][0] = gain_check.surplus(settings[0], 0.0)


def _set_walls(settings, values):
    offsets, normals = values["wall.offsets"], values["wall.normals"]
    count = len(offsets)
    if count > MOST_WALLS:
        raise ValueError(f"wall.offsets names {count} walls; the limit is {MOST_WALLS}")
    for name, per_wall in (("wall.normals", 2), ("wall.stiffness", 1), ("wall.damping", 1)):
        if len(values[name]) != per_wall * count:
            raise ValueError(f"{name} has {len(values[name])} numbers; {count} walls need {per_wall * count}")
    settings["walls"] = count
    for i in range(count):
        nx, ny = normals[2 * i : 2 * i + 2]
        length = math.hypot(nx, ny)
        if abs(length - 1.0) > 1e-3:
            raise ValueError(f"wall.normals of wall {i} is [{nx:g}, {ny:g}], of length {length:g}; write a unit vector")
        if abs(ny) > 1e-3 and int(settings["axes"][0]) < 2:
            raise ValueError(f"wall.normals of wall {i} is [{nx:g}, {ny:g}]; the device has no y axis, so ny must be 0")
        settings["wall_x"][0, i], settings["wall_y"][0, i] = nx / length, ny / length
        settings["wall_offset"][0, i] = offsets[i]
        settings["wall_stiffness"][0, i], settings["wall_damping"][0, i] = (
            values["wall.stiffness"][i],
            values["wall.damping"][i],
        )


def gains_from(values):
    """GAINS record of the coupling, as the exchange ships them."""
    gains = np.zeros(1, COUPLING_GAINS)
    names = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    numbers = [values[f"coupling.{name}"] for name in names]
    for name, number in zip(names, numbers, strict=True):
        gains[name] = number
    gains["hash"] = exchange_samples.gains_hash(*numbers)
    return gains
