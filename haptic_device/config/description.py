# SPDX-License-Identifier: Apache-2.0
"""Device description: what a haptic device is made of, in SI, read from YAML."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from haptic_device.config import yaml_reader
from haptic_device.config.files import ConfigError, find
from haptic_device.config.link_registry import Link
from haptic_device.config.refusal import Part, Unit, sentences
from haptic_device.message_fields import AXES

Positive = Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False, strict=True)]
Number = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False, strict=True)]
Sign = Literal[1, -1]
STRAIGHT, TURNING = (5.0, "m", "mm"), (8.0 * math.pi, "rad", "degrees")
"""Farthest from 0 that a handle is led, a step and an arm, or four turns; its unit, and one that is no SI."""
FEWEST = 100  # counts in a workspace: with fewer, one is more than a hundredth of it
SUB_STEP = 50_000  # [ns] longest step of the simulated device's exact motion
MOST_STIFF = 1.0 / (SUB_STEP * 1e-9)  # [1/s] damping over mass up to which the plant's series converges fast


class DragSensor(Part):
    """Sensor of the physical damper's drag, per axis.

    Attributes:
        bandwidth (float): of its low-pass filter [Hz]; 0 means no filter.
        bias (float): constant error of the reading [N | N m].
        noise (float): standard deviation of the reading [N | N m].

    Examples:
        >>> from haptic_device.config.description import DragSensor
        >>> DragSensor(bandwidth=500.0)
        DragSensor(bandwidth=500.0, bias=0.0, noise=0.0)
    """

    bandwidth: Annotated[NotNegative, Unit("Hz")] = 0.0
    bias: Annotated[Number, Unit("N or N m")] = 0.0
    noise: Annotated[NotNegative, Unit("N or N m")] = 0.0


class Axis(Part):
    """One axis: x and y in metres and newtons, theta in radians and newton metres.

    Attributes:
        name: x, y or theta.
        counts_per_unit (float): encoder counts per m | rad; at least 100 in the workspace.
        encoder_sign: −1 where the encoder counts the other way.
        zero (float): position of the device where the encoder counts 0 [m | rad].
        motor_constant (float): force per unit of the motor's command [N | N m].
        motor_sign: −1 where the motor pushes the other way.
        motor_limit (float): largest force of the motor [N | N m].
        workspace (tuple[float, float]): lowest and highest position, at most 5 m or four turns from 0 [m | rad].
        velocity_limit (float): largest speed allowed for the axis [m/s | rad/s].
        mass (float): moving mass or inertia m of the mechanism [kg | kg m²].
        damping (float): physical damping b of the mechanism [N s/m | N m s/rad].
        coulomb (float): Coulomb friction of the mechanism [N | N m].

    Examples:
        >>> from haptic_device.config.description import load_device
        >>> axis = load_device("desktop").axes[0]
        >>> axis.name, axis.mass, axis.damping
        ('x', 0.1, 3.0)
    """

    name: Literal["x", "y", "theta"]
    counts_per_unit: Annotated[Positive, Unit("counts/m | counts/rad")]
    encoder_sign: Sign = 1
    zero: Annotated[Number, Unit("m | rad")] = 0.0
    motor_constant: Annotated[Positive, Unit("N per motor unit | N m per motor unit")] = 1.0
    motor_sign: Sign = 1
    motor_limit: Annotated[Positive, Unit("N | N m")]
    workspace: Annotated[tuple[Number, Number], Unit("m | rad")]
    velocity_limit: Annotated[Positive, Unit("m/s | rad/s")]
    mass: Annotated[Positive, Unit("kg | kg m²")]
    damping: Annotated[Positive, Unit("N s/m | N m s/rad")]
    coulomb: Annotated[NotNegative, Unit("N | N m")] = 0.0

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        if self.damping / self.mass > MOST_STIFF:
            raise ValueError(f"damping/mass is {self.damping / self.mass:g} 1/s; the limit is {MOST_STIFF:g} 1/s")
        (low, high), (far, unit, other) = self.workspace, TURNING if self.name == "theta" else STRAIGHT
        if max(-low, high) > far:
            raise ValueError(f"workspace is [{low:g}, {high:g}] {unit}; the limit is ±{far:.4g} {unit} (not {other})")
        if (count := self.counts_per_unit * (high - low)) < FEWEST:
            given = f"counts_per_unit is {self.counts_per_unit:g} counts/{unit}, {count:.4g} in the workspace"
            raise ValueError(f"{given}; at least {FEWEST} counts in it are needed")
        return self

    @field_validator("workspace")
    @classmethod
    def _rising(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] >= value[1]:
            raise ValueError("write [low, high]")
        return value


class Device(Part):
    """A device with the axes x; or x and y; or x, y and theta. It is immutable.

    Attributes:
        name: name of the device.
        axes (tuple[Axis, ...]): its axes, in the order x, y, theta.
        gravity (tuple[float, float]): acceleration along x and y that pulls at the handle's mass [m/s²].
        gravity_compensation: whether the driver compensates that weight.
        sensing_delay (float): time from the position to its sample [s].
        actuation_delay (float): time from the command to its force [s].
        stamp_error (float): half-width of what is not known of the time of a sample [s].
        scale (tuple[float, float]): world metres per device metre, and radians per radian. The hand feels a world
            stiffness scale² times.
        homing: with `at_start`, home is where the handle is when the driver starts.
        home (tuple[float, float, float]): position of the handle at home [m, m, rad].
        drag_sensor: sensor of the damper's drag.
        link: what connects the device (haptic_device/config/link_registry.py); `loopback` is the simulated device.

    Examples:
        >>> from haptic_device.config.description import load_device
        >>> device = load_device("desktop")
        >>> [axis.name for axis in device.axes], device.link.type
        (['x', 'y', 'theta'], 'loopback')
        >>> softer = device.model_copy(update={"scale": (0.5, 1.0)})  # another device, the first stays as it is
        >>> softer.scale, device.scale
        ((0.5, 1.0), (1.0, 1.0))
    """

    name: str
    axes: Annotated[tuple[Axis, ...], Field(min_length=1, max_length=3)]
    gravity: Annotated[tuple[Number, Number], Unit("m/s²")] = (0.0, 0.0)
    gravity_compensation: bool = True
    sensing_delay: Annotated[NotNegative, Field(le=0.1), Unit("s")] = 0.0
    actuation_delay: Annotated[NotNegative, Field(le=0.04), Unit("s")] = 0.0
    stamp_error: Annotated[NotNegative, Field(le=0.01), Unit("s")] = 0.0
    scale: tuple[Positive, Positive] = (1.0, 1.0)
    homing: Literal["absolute", "at_start"] = "absolute"
    home: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    drag_sensor: DragSensor = DragSensor()
    link: Link = Link(type="loopback")

    @model_validator(mode="after")
    def _axes_in_order(self) -> Self:
        names = tuple(axis.name for axis in self.axes)
        if names != AXES[: len(names)]:
            raise ValueError(f"axes are {', '.join(names)}; write x, or x and y, or x, y and theta, in this order")
        return self

    def weight(self, axis: int) -> float:
        """Force of gravity on the handle [N] along axis 0…2, in the device's frame."""
        return self.axes[axis].mass * self.gravity[axis] if axis < min(2, len(self.axes)) else 0.0


def load_device(name: str | Path) -> Device:
    """Loads the device of this name in config/devices, or of the YAML file at this path.

    Raises FileNotFoundError if there is neither, and ConfigError with one sentence if the file is wrong.

    Args:
        name: a name, or the path of a file.

    Examples:
        >>> from haptic_device.config.description import load_device
        >>> load_device("desktop").name
        'desktop'
        >>> load_device("destkop")
        Traceback (most recent call last):
            ...
        FileNotFoundError: destkop is neither a file nor a name in config/devices, ...; did you mean desktop?
    """
    path = find("devices", name)
    return parse(yaml_reader.load(path), str(path))


def parse(content: Any, source: str) -> Device:
    """Makes a device from a mapping with the keys of the YAML file.

    Raises ConfigError: its text is the first error, and its `found` has all errors.

    Args:
        content: the mapping.
        source: name of the mapping in the sentence of an error.

    Examples:
        >>> from haptic_device.config.description import parse
        >>> parse({"name": "rail", "axes": []}, "rail.yaml")
        Traceback (most recent call last):
            ...
        haptic_device.config.files.ConfigError: rail.yaml: axes: it should have at least 1 item and has 0
    """
    try:
        return Device.model_validate(content)
    except ValidationError as error:
        found = sentences(error, Device, lambda place: place[:2] == ("axes", 2))
        raise ConfigError(f"{source}: {found[0]}", found) from None
