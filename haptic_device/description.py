# SPDX-License-Identifier: Apache-2.0
"""Device description: what a haptic device is made of, in SI, read from YAML."""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from haptic_device import yaml_reader
from haptic_device.config_files import ConfigError, find
from haptic_device.link_registry import Link
from haptic_device.message_fields import AXES
from haptic_device.refusal import Part, Unit, sentences

Positive = Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False, strict=True)]
Number = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False, strict=True)]
Sign = Literal[1, -1]
SUB_STEP = 50_000  # [ns] longest step of the simulated device's exact motion
MOST_STIFF = 1.0 / (SUB_STEP * 1e-9)  # [1/s] damping over mass up to which the plant's series converges fast


class DragSensor(Part):
    """Sensor of the physical damper's drag: bandwidth [Hz] (0 = unlimited), bias and noise (σ) [N | N m]."""

    bandwidth: Annotated[NotNegative, Unit("Hz")] = 0.0
    bias: Annotated[Number, Unit("N or N m")] = 0.0
    noise: Annotated[NotNegative, Unit("N or N m")] = 0.0


class Axis(Part):
    """One axis: metres and newtons for x and y, radians and newton metres for theta.

    counts_per_unit: encoder counts per m | rad. encoder_sign, motor_sign: −1 where the hardware counts or pushes the
    other way. zero: device position at count 0. motor_constant: N | N m per motor unit. motor_limit, workspace,
    velocity_limit: what the axis stands; mass (inertia), damping b and coulomb friction f_c of the mechanism.
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
        return self

    @field_validator("workspace")
    @classmethod
    def _rising(cls, value: tuple[float, float]) -> tuple[float, float]:
        if value[0] >= value[1]:
            raise ValueError("write [low, high]")
        return value


class Device(Part):
    """A device with axes x, x and y, or x, y and theta.

    gravity: acceleration [m/s²] along x and y that pulls at the handle's mass; compensated by the driver if
    gravity_compensation. delays [s]. scale: world metres per device metre, and radians per radian; a world stiffness is
    felt scale² times as stiff. homing `at_start`: where the handle is when the driver starts is taken as its home.
    link: what it is connected by (haptic_device/link_registry); haptic_loopback stands in for it by default.
    """

    name: str
    axes: Annotated[tuple[Axis, ...], Field(min_length=1, max_length=3)]
    gravity: Annotated[tuple[Number, Number], Unit("m/s²")] = (0.0, 0.0)
    gravity_compensation: bool = True
    sensing_delay: Annotated[NotNegative, Field(le=0.1), Unit("s")] = 0.0
    actuation_delay: Annotated[NotNegative, Field(le=0.04), Unit("s")] = 0.0
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
        """Force of gravity on the handle [N] along axis 0…2."""
        return self.axes[axis].mass * self.gravity[axis] if axis < min(2, len(self.axes)) else 0.0


def load_device(name: str | Path) -> Device:
    """The device of this name (config/devices) or file. Raises ConfigError or FileNotFoundError, one sentence."""
    path = find("devices", name)
    return parse(yaml_reader.load(path), str(path))


def parse(content: Any, source: str) -> Device:
    """A device from a mapping; `source` names it in the sentence of a ConfigError."""
    try:
        return Device.model_validate(content)
    except ValidationError as error:
        found = sentences(error, Device, lambda place: place[:2] == ("axes", 2))
        raise ConfigError(f"{source}: {found[0]}", found) from None
