# SPDX-License-Identifier: Apache-2.0
"""Operating point: parameter values on a device, made into the record the servo takes."""

import math

import numpy as np

from haptic_device.config.description import linkage_of
from haptic_device.config.drives import drives
from haptic_device.config.parameters import LEAST_UNATTENDED, MOST_WALLS, OPERATING_POINT
from haptic_device.control import exchange_samples, gain_check, linkage, records
from haptic_device.control.exchange_samples import COUPLING_GAINS, METHODS
from haptic_device.control.set_position import DAMPER_SLEW

MOST_LATE = records.HELD - 4  # periods: motor values on their way are remembered, and a write may be late too
ATTENDED_EVERY = 0.05  # [s] the driver says that it is there
ARM = 0.05  # [m] between grip and tip, which turns accelerations into angular ones
SAME = {
    (group, name)
    for group in records.SETTINGS.names
    for name in records.SETTINGS[group].names or ()
    if records.SETTINGS[group][name].shape == ()
}
"""Group and name of the numbers of the record that are parameters of the same name; a choice is its number there."""


def settings_of(device):
    """SETTINGS record of the servo with what the device description says; gains and limits are still to be set."""
    settings = np.zeros(1, records.SETTINGS)
    settings["axes"], described = len(device.axes), settings["hardware"][0]
    described["scale"] = device.scale[0], device.scale[0], device.scale[1]
    described["delay"], described["stamp_error"] = device.sensing_delay + device.actuation_delay, device.stamp_error
    for i, axis in enumerate(device.axes):
        described["gravity"][i] = -device.weight(i) if device.gravity_compensation else 0.0
        described["damping"][i], described["friction"][i] = axis.damping, axis.coulomb
        described["position_low"][i], described["position_high"][i] = axis.workspace
        described["velocity_limit"][i] = axis.velocity_limit
        described["most_force"][i], described["step"][i] = axis.motor_limit, 1.0 / axis.counts_per_unit
    for i, drive in enumerate(drives(device)):
        described["position_per_count"][i], described["zero"][i] = drive.step, -drive.zero
        described["motor_per_force"][i], described["motor_limit"][i] = 1.0 / drive.force, drive.limit
    settings["port"]["joints"], settings["port"]["lever"] = len(device.joints), 1.0
    if device.joints:
        _join(device, settings[0])
    return settings


def _join(device, settings):
    """What of a linkage's settings is its joints'. One turns as fast, and its torque, as the worst pose asks for."""
    linkage.fill(settings["linkage"], device.kinematics)
    described, port, count = settings["hardware"], settings["port"], len(device.joints)
    # it is a force in any direction, and limits are those of axes
    described["most_force"][:count] /= math.sqrt(count)
    jacobians = np.array(linkage_of(device.kinematics, device.joints, device.handle))
    speed = np.abs(np.linalg.inv(jacobians)) @ described["velocity_limit"][:count]
    port["fastest"][:count] = speed.max(axis=0)
    port["lever"][:count] = described["scale"][0] * np.linalg.norm(jacobians, axis=1).max(axis=0)
    for i, joint in enumerate(device.joints):
        port["damping"][i], port["step"][i] = joint.damping, joint.step


def settings_from(device, values, version=0):
    """Settings of the servo at an operating point: a structured array with one record, SETTINGS of control/records.

    Its passivity margin is that of writes on time. Raises ValueError with one sentence if values do not fit together or
    do not fit the device.

    Args:
        device: a `Device`.
        values: all parameters of haptic_driver, {name: value}.
        version: number of these settings.

    Examples:
        >>> from haptic_device.control.controller_config import settings_from
        >>> from haptic_device.config.description import load_device
        >>> from haptic_device.config.parameter_types import defaults
        >>> from haptic_sim.node.parameters import NODES
        >>> settings = settings_from(load_device("desktop"), defaults(NODES["haptic_driver"]))
        >>> print(settings["period"][0], settings["coupling"]["stiffness"][0])  # [s], [N/m, N/m, N m/rad]
        0.00025 [1000. 1000.    1.]
    """
    settings = settings_unjudged(device, values, version)
    return gain_check.counted(settings, gain_check.delays(settings[0]))


def settings_unjudged(device, values, version=0):
    """As settings_from, still without what is left of the device's damping (gain_check.judge)."""
    settings = settings_of(device)
    settings["version"], settings["period"] = version, 1.0 / values["servo.rate"]
    late, rate = float(settings["hardware"]["delay"][0]) * values["servo.rate"], values["servo.rate"]
    if late > MOST_LATE:
        raise ValueError(
            f"the device's delays are {late:g} periods at servo.rate {rate:g} Hz; the limit is {MOST_LATE}"
        )
    if 0.0 < (alone := values["fault.unattended"]) < LEAST_UNATTENDED:
        raise ValueError(
            f"fault.unattended is {alone:g} s, and the driver says each {ATTENDED_EVERY:g} s that it is there: "
            f"take 0 (never), or {LEAST_UNATTENDED:g} s and more"
        )
    if device.joints and values["cancellation.source"] == "measured":
        raise ValueError("cancellation.source is measured, and a linkage has no drag sensor; take model")
    for parameter in OPERATING_POINT:
        group, _, name = parameter.name.partition(".")
        if (group, name) in SAME:
            value = values[parameter.name]
            settings[group][name] = parameter.choices.index(value) if parameter.choices else value
    for name in ("stiffness", "damping"):
        settings["coupling"][name][0, :2] = values[f"coupling.{name}"]
        settings["coupling"][name][0, 2] = values[f"coupling.rotational_{name}"]
    settings["fault"]["duty_kept"] = math.exp(-1.0 / (values["servo.rate"] * values["fault.duty_time"]))
    settings["force"]["limit"][0] = (values["force.limit"], values["force.limit"], values["force.limit_rotational"])
    _set_walls(settings, values)
    _set_exchange(settings, values)
    _set_port(settings)
    return settings


def _set_port(settings):
    """What the account counts with, in the world; of the lateness: gain_check.counted."""
    port, device, slew = settings["port"], settings["hardware"], settings["exchange"]["slew"]
    # springs have the slew, and dampers their share on top of it
    port["period"], port["slew"] = settings["period"], port["lever"] * ((1.0 + DAMPER_SLEW) * slew)
    axes = slice(int(port["joints"].ravel()[0]), None)  # those of a linkage's joints are as they are (_join)
    scale = device["scale"][..., axes]
    port["fastest"][..., axes] = device["velocity_limit"][..., axes] * scale
    port["step"][..., axes] = np.abs(device["position_per_count"][..., axes]) * scale
    port["damping"][..., axes] = device["damping"][..., axes] / scale**2


def _set_exchange(settings, values):
    """Settings of the exchange that follow from others."""
    settings["exchange"]["method"] = METHODS[values["exchange.method"]]  # which is not its place among the choices
    device = settings["hardware"]
    held = (device["most_force"] - np.abs(device["gravity"])) / device["scale"]
    settings["coupling"]["limit"] = np.maximum(0.0, np.minimum(settings["force"]["limit"], held))
    ratio = values["force.limit_rotational"] / values["force.limit"] if values["force.limit"] > 0.0 else 1.0
    settings["exchange"]["slew"][0] = values["exchange.slew"] * np.array([1.0, 1.0, ratio])
    settings["exchange"]["agility"][0] = values["exchange.agility"] * np.array([1.0, 1.0, 1.0 / ARM])


def _set_walls(settings, values):
    for sentence in wall_problems(int(settings["axes"][0]), values):
        raise ValueError(sentence)
    walls, count, normals = settings["wall"][0], len(values["wall.offsets"]), values["wall.normals"]
    lengths = [math.hypot(*normal) for normal in zip(normals[::2], normals[1::2], strict=True)]
    walls["count"] = count
    walls["x"][:count], walls["y"][:count] = np.divide(normals[::2], lengths), np.divide(normals[1::2], lengths)
    for name, parameter in (("offset", "offsets"), ("stiffness", "stiffness"), ("damping", "damping")):
        walls[name][:count] = values[f"wall.{parameter}"]


def wall_problems(axes, values):
    """One sentence for each thing that does not fit in the walls of these values, on a device of so many axes."""
    normals, count = values["wall.normals"], len(values["wall.offsets"])
    if count > MOST_WALLS:
        yield f"wall.offsets names {count} walls; the limit is {MOST_WALLS}"
    for name, per_wall in (("wall.normals", 2), ("wall.stiffness", 1), ("wall.damping", 1)):
        if len(values[name]) != per_wall * count:
            yield (
                f"{name} has {len(values[name])} numbers; {count} walls (wall.offsets) need {per_wall * count}: "
                "set the four lists of wall together"
            )
    for i, (nx, ny) in enumerate(zip(normals[::2], normals[1::2], strict=False)):
        length = math.hypot(nx, ny)
        if abs(length - 1.0) > 1e-3:
            yield f"wall.normals of wall {i} is [{nx:g}, {ny:g}], of length {length:g}; write a unit vector"
        elif abs(ny) > 1e-3 and axes < 2:
            yield f"wall.normals of wall {i} is [{nx:g}, {ny:g}]; the device has no y axis, so ny must be 0"


def gains_from(values, settings):
    """GAINS record of the coupling, as the exchange ships them; settings: for the limits."""
    gains = np.zeros(1, COUPLING_GAINS)
    names = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    for name in names:
        gains[name] = values[f"coupling.{name}"]
    gains["hash"] = exchange_samples.gains_hash(*(values[f"coupling.{name}"] for name in names))
    gains["limit"] = settings["coupling"]["limit"]
    return gains
