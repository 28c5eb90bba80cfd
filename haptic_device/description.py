# SPDX-License-Identifier: Apache-2.0
"""Device description: what a haptic device is made of, in SI, read from YAML."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from haptic_device.config_files import ConfigError, find
from haptic_device.parameter_types import unknown

Positive = Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False, strict=True)]
Number = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False, strict=True)]
Sign = Literal[1, -1]
_Error = TypeVar("_Error", bound=Mapping[str, Any])  # as pydantic tells it
AXES = ("x", "y", "theta")
SUB_STEP = 50_000  # [ns] longest step of the simulated device's exact motion
MOST_STIFF = 1.0 / (SUB_STEP * 1e-9)  # [1/s] damping over mass up to which the plant's series converges fast


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
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
        if not isinstance(content, dict):
            raise ConfigError(f"{path}: the file holds no mapping of names to values")
        return Device.model_validate(content)
    except ValidationError as error:
        found = _sentences(error)
        raise ConfigError(f"{path}: {found[0]}", found) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not YAML: {' '.join(str(error).split())}") from None


def _sentences(errors: ValidationError) -> list[str]:
    """Each problem of a validation: where, what was given, what is wanted."""
    return [_sentence(error) for error in without_echoes(errors.errors())]


def without_echoes(errors: Sequence[_Error]) -> list[_Error]:
    """Without what pydantic calls too short only because the items that it had were wrong."""
    places = [error["loc"] for error in errors]

    def echo(error: _Error) -> bool:
        own = error["loc"]
        return error["type"] == "too_short" and any(place != own and place[: len(own)] == own for place in places)

    return [error for error in errors if not echo(error)]


def _sentence(error: Mapping[str, Any]) -> str:
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".")
    if error["type"] == "extra_forbidden":
        known = {**Axis.model_fields, **Device.model_fields, **DragSensor.model_fields}
        last = str(error["loc"][-1])
        return where.removesuffix(last) + unknown(last, "a key of a device description", known)
    reason = error["msg"].removeprefix("Value error, ")
    given = "" if isinstance(error["input"], dict) else f"{where} is {error['input']!r}: "
    return f"{given or where + ': '}{reason[0].lower()}{reason[1:]}"
