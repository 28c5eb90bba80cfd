# SPDX-License-Identifier: Apache-2.0
"""Device description: what a haptic device is made of, in SI, read from YAML; made into the records the laws take."""

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from haptic_device.law import plant, servo
from haptic_device.parameter import unknown
from haptic_device.share import find

Positive = Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False, strict=True)]
Number = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False, strict=True)]
Sign = Literal[1, -1]
AXES = ("x", "y", "theta")
MOST_STIFF = 1.0 / (plant.SUB_STEP * 1e-9)  # [1/s] damping over mass up to which the plant's series converges fast


class Part(BaseModel):
    """Frozen, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class DragSensor(Part):
    """Sensor of the physical damper's drag: bandwidth [Hz] (0 = unlimited), bias and noise (σ) [N | N m]."""

    bandwidth: NotNegative = 0.0
    bias: Number = 0.0
    noise: NotNegative = 0.0


class Axis(Part):
    """One axis: metres and newtons for x and y, radians and newton metres for theta.

    counts_per_unit: encoder counts per m | rad. encoder_sign, motor_sign: −1 where the hardware counts or pushes the
    other way. zero: device position at count 0. motor_constant: N | N m per motor unit. motor_limit, workspace,
    velocity_limit: what the axis stands; mass (inertia), damping b and coulomb friction f_c of the mechanism.
    """

    name: Literal["x", "y", "theta"]
    counts_per_unit: Positive
    encoder_sign: Sign = 1
    zero: Number = 0.0
    motor_constant: Positive = 1.0
    motor_sign: Sign = 1
    motor_limit: Positive
    workspace: tuple[Number, Number]
    velocity_limit: Positive
    mass: Positive
    damping: Positive
    coulomb: NotNegative = 0.0

    @model_validator(mode="after")
    def _sensible(self):
        if self.workspace[0] >= self.workspace[1]:
            raise ValueError(f"workspace is {list(self.workspace)}; write [low, high]")
        if self.damping / self.mass > MOST_STIFF:
            raise ValueError(f"damping/mass is {self.damping / self.mass:g} 1/s; the limit is {MOST_STIFF:g} 1/s")
        return self


class Device(Part):
    """A device with axes x, x and y, or x, y and theta.

    gravity: acceleration [m/s²] along x and y that pulls at the handle's mass; compensated by the driver if
    gravity_compensation. delays [s]. scale: world metres per device metre, and radians per radian; a world stiffness is
    felt scale² times as stiff. homing `at_start`: where the handle is when the driver starts is taken as its home.
    """

    name: str
    axes: Annotated[tuple[Axis, ...], Field(min_length=1, max_length=3)]
    gravity: tuple[Number, Number] = (0.0, 0.0)
    gravity_compensation: bool = True
    sensing_delay: Annotated[NotNegative, Field(le=0.1)] = 0.0
    actuation_delay: Annotated[NotNegative, Field(le=0.04)] = 0.0
    scale: tuple[Positive, Positive] = (1.0, 1.0)
    homing: Literal["absolute", "at_start"] = "absolute"
    home: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    drag_sensor: DragSensor = DragSensor()

    @model_validator(mode="after")
    def _axes_in_order(self):
        names = tuple(axis.name for axis in self.axes)
        if names != AXES[: len(names)]:
            raise ValueError(f"axes are {', '.join(names)}; write x, or x and y, or x, y and theta, in this order")
        return self

    def weight(self, axis):
        """Force of gravity on the handle [N] along axis 0…2."""
        return self.axes[axis].mass * self.gravity[axis] if axis < min(2, len(self.axes)) else 0.0


def load_device(name):
    """The device of this name (config/devices) or file. Raises ValueError, one sentence; FileNotFoundError likewise."""
    path = find("devices", name)
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        if not isinstance(content, dict):
            raise ValueError(f"{path}: the file holds no mapping of names to values")
        return Device.model_validate(content)
    except ValidationError as error:
        raise ValueError(f"{path}: {_sentence(error)}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not YAML: {' '.join(str(error).split())}") from None


def _sentence(error):
    """The first problem of a validation: where, what was given, what is wanted."""
    first = error.errors()[0]
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    if first["type"] == "extra_forbidden":
        known = {**Axis.model_fields, **Device.model_fields, **DragSensor.model_fields}
        last = str(first["loc"][-1])
        return where.removesuffix(last) + unknown(last, "a key of a device description", known)
    reason = first["msg"].removeprefix("Value error, ")
    given = "" if isinstance(first["input"], dict) else f"{where} is {first['input']!r}: "
    return f"{given or where + ': '}{reason[0].lower()}{reason[1:]}"


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


def plant_of(device):
    """PLANT record of the loopback: the device as the description has it, no hand on it yet."""
    record = np.zeros(1, plant.PLANT)
    record["axes"] = len(device.axes)
    record["sensing_delay"], record["actuation_delay"] = device.sensing_delay * 1e9, device.actuation_delay * 1e9
    sensor = device.drag_sensor
    record["drag_bandwidth"] = 2.0 * math.pi * sensor.bandwidth
    record["drag_bias"], record["drag_noise"] = sensor.bias, sensor.noise
    record["mass"] = record["position_per_count"] = 1.0  # of the axes that are not there
    for i, axis in enumerate(device.axes):
        record["mass"][0, i], record["damping"][0, i] = axis.mass, axis.damping
        record["coulomb"][0, i], record["gravity"][0, i] = axis.coulomb, device.weight(i)
        record["position_per_count"][0, i] = axis.encoder_sign / axis.counts_per_unit
        record["zero"][0, i] = -axis.zero
        record["force_per_motor"][0, i] = axis.motor_sign * axis.motor_constant
        record["force_limit"][0, i] = axis.motor_limit
    return record
