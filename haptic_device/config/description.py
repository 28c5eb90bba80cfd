# SPDX-License-Identifier: Apache-2.0
"""Device description: what a haptic device is made of, in SI, read from YAML."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, ValidationError, ValidationInfo, field_validator, model_validator

from haptic_device.config import yaml_reader
from haptic_device.config.files import ConfigError, find
from haptic_device.config.kinematics import CLEAR, Kinematics, Number
from haptic_device.config.link_registry import Link
from haptic_device.config.refusal import Part, Unit, sentences
from haptic_device.message_fields import AXES

Positive = Annotated[float, Field(gt=0.0, le=1e9, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0.0, le=1e9, allow_inf_nan=False, strict=True)]
Sign = Literal[1, -1]
STRAIGHT, TURNING = (5.0, "m", "mm"), (8.0 * math.pi, "rad", "degrees")
"""Farthest from 0 that a handle is led, a step and an arm, or four turns; its unit, and one that is no SI."""
RESERVED = *AXES, "elbow_1", "elbow_2", "pivot"  # names of other joints in ROS
FEWEST = 100  # counts in a workspace: with fewer, one is more than a hundredth of it
SUB_STEP = 50_000  # [ns] longest step of the simulated device's exact motion
MOST_STIFF = 1.0 / (SUB_STEP * 1e-9)  # [1/s] damping over mass up to which the plant's series converges fast


def _rising(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] >= value[1]:
        raise ValueError("write [low, high]")
    return value


Range = Annotated[tuple[Number, Number], AfterValidator(_rising)]


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
    workspace: Annotated[Range, Unit("m | rad")]
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


class Joint(Part):
    """One motor of a linkage, and what turns with it.

    Attributes:
        name: of the joint in ROS.
        counts_per_rad (float): encoder counts per rad of the motor.
        encoder_sign, motor_sign: −1 where the encoder counts, or the motor turns, the other way.
        zero (float): angle of the joint where the encoder counts 0 [rad].
        gear (float): turns of the motor per turn of the joint.
        torque_constant (float): torque of the motor per unit of its command [N m].
        torque_limit (float): largest torque of the motor [N m].
        damping, inertia, coulomb (float): of the joint: physical damping b [N m s/rad], moment of inertia [kg m²],
            Coulomb friction [N m].
        limits (tuple[float, float]): angles that the joint can reach [rad].
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")]
    counts_per_rad: Annotated[Positive, Unit("counts/rad")]
    encoder_sign: Sign = 1
    zero: Annotated[Number, Unit("rad")] = 0.0
    gear: Positive = 1.0
    torque_constant: Annotated[Positive, Unit("N m per motor unit")] = 1.0
    motor_sign: Sign = 1
    torque_limit: Annotated[Positive, Unit("N m")]
    damping: Annotated[Positive, Unit("N m s/rad")]
    inertia: Annotated[Positive, Unit("kg m²")]
    coulomb: Annotated[NotNegative, Unit("N m")] = 0.0
    limits: Annotated[Range, Unit("rad")]

    @property
    def step(self) -> float:
        """Angle of an encoder count [rad]."""
        return 1.0 / (self.gear * self.counts_per_rad)

    @property
    def limit(self) -> float:
        """Largest torque at the joint [N m]."""
        return self.gear * self.torque_limit

    def turned(self, angle: float) -> float:
        """This angle or one some whole turns away, the nearest to the middle of the limits [rad]."""
        return angle + 2.0 * math.pi * round((sum(self.limits) / 2.0 - angle) / (2.0 * math.pi))


class Handle(Part):
    """The end of a linkage.

    Attributes:
        mass (float): of the handle and of what moves with it [kg].
        workspace (tuple[tuple[float, float], ...]): lowest and highest place along x, and y, from `origin` [m].
        use_workspace: a smaller one, in place of it: gains are judged there, and beyond it is a fault.
        velocity_limit (float): largest speed allowed along each axis [m/s].
    """

    mass: Annotated[Positive, Unit("kg")]
    workspace: Annotated[tuple[Range, ...], Field(min_length=1, max_length=2), Unit("m")]
    use_workspace: Annotated[tuple[Range, ...], Unit("m")] | None = None
    velocity_limit: Annotated[Positive, Unit("m/s")]

    @model_validator(mode="after")
    def _within(self) -> Self:
        whole, used = self.workspace, self.used
        if len(used) != len(whole) or any(c < a or d > b for (a, b), (c, d) in zip(whole, used, strict=True)):
            raise ValueError(f"use_workspace is {_places(used)} m; it must lie in workspace, {_places(whole)} m")
        return self

    @property
    def used(self) -> tuple[tuple[float, float], ...]:
        """The workspace in which the device is used [m]."""
        return self.use_workspace or self.workspace


def _places(workspace: tuple[tuple[float, float], ...]) -> str:
    return str([list(along) for along in workspace])


class Device(Part):
    """A device with the axes x; or x and y; or x, y and theta. It is immutable.

    Attributes:
        name: name of the device.
        kinematics: what joins motors and handle; without it each motor moves an axis.
        joints (tuple[Joint, ...]): of a linkage: its motors.
        handle (Handle): of a linkage: its end.
        axes (tuple[Axis, ...]): its axes, in the order x, y, theta. Of a linkage only theta may be written, which a
            motor of its own turns; x and y follow, as they are felt at the worst pose: the least force, damping, mass
            and friction in any direction, and the largest encoder step.
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
    kinematics: Kinematics = Kinematics()
    joints: Annotated[tuple[Joint, ...], Field(max_length=2)] = ()
    handle: Annotated[Handle | None, Field(validate_default=True)] = None
    axes: Annotated[tuple[Axis, ...], Field(max_length=3, validate_default=True)] = ()
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

    @field_validator("handle")
    @classmethod
    def _fit_together(cls, handle: Handle | None, info: ValidationInfo) -> Handle | None:
        if (kinematics := info.data.get("kinematics")) and kinematics.joints and "joints" in info.data:
            linkage_of(kinematics, info.data["joints"], handle)
        elif kinematics and not kinematics.joints and (handle or info.data.get("joints")):
            raise ValueError("joints and handle are of a linkage; write the type of its kinematics")
        return handle

    @field_validator("axes", mode="before")
    @classmethod
    def _as_felt(cls, axes: Any, info: ValidationInfo) -> Any:
        """x and y of a linkage, before what is written of theta."""
        known = info.data
        if not (known.get("handle") and known.get("joints") and known.get("kinematics", Kinematics()).joints):
            return axes
        if any(not isinstance(axis, dict) or axis.get("name") != "theta" for axis in axes):
            raise ValueError("x and y of a linkage follow from its joints and handle; write theta alone, or no axes")
        return [*_felt_axes(known["kinematics"], known["joints"], known["handle"]), *axes]

    @field_validator("axes")
    @classmethod
    def _some(cls, axes: tuple[Axis, ...], info: ValidationInfo) -> tuple[Axis, ...]:
        if not axes and "handle" in info.data:  # else that is what is wrong
            raise ValueError("it should have at least 1 item and has 0")
        return axes

    @model_validator(mode="after")
    def _lies_flat(self) -> Self:
        if self.joints and any(self.gravity):
            raise ValueError(f"gravity is {list(self.gravity)} m/s²; a linkage lies flat: leave it out")
        if self.joints and self.drag_sensor != DragSensor():
            raise ValueError("a linkage has no drag_sensor: leave it out")
        if self.joints and self.homing == "at_start":
            for at, (low, high) in zip(self.home, self.handle.workspace if self.handle else (), strict=False):
                if not low <= at <= high:
                    given = f"home has {at:g} m; with homing at_start it is where the handle is then"
                    raise ValueError(f"{given}, within the workspace, {low:g} to {high:g} m")
        return self

    @model_validator(mode="after")
    def _axes_in_order(self) -> Self:
        names = tuple(axis.name for axis in self.axes)
        if names != AXES[: len(names)]:
            raise ValueError(f"axes are {', '.join(names)}; write x, or x and y, or x, y and theta, in this order")
        return self

    @property
    def used(self) -> tuple[tuple[float, float], ...]:
        """The workspace of a linkage's handle that is used [m]."""
        return self.handle.used if self.handle else ()

    def weight(self, axis: int) -> float:
        """Force of gravity on the handle [N] along axis 0…2, in the device's frame."""
        return self.axes[axis].mass * self.gravity[axis] if axis < min(2, len(self.axes)) else 0.0


def linkage_of(kinematics: Kinematics, joints: tuple[Joint, ...], handle: Handle | None) -> list[list[list[float]]]:
    """Jacobians of a linkage, as Kinematics.jacobian, all over the workspace that is used.

    Raises ValueError with one sentence if joints, handle and workspace do not fit together.
    """
    if handle is None or len(joints) != kinematics.joints:
        given = f"{'joint' if len(joints) == 1 else 'joints'} and {'no' if handle is None else 'a'} handle"
        needed = f"{kinematics.joints} {'joint' if kinematics.joints == 1 else 'joints'} and a handle"
        raise ValueError(f"kinematics of type {kinematics.type} need {needed}; given are {len(joints)} {given}")
    if len({*RESERVED, *(joint.name for joint in joints)}) < len(RESERVED) + len(joints):
        names = ", ".join(joint.name for joint in joints)
        raise ValueError(f"joints are {names}; each needs a name of its own, and none of {', '.join(RESERVED)}")
    for joint in joints if len(joints) == 2 else ():
        if (way := joint.limits[1] - joint.limits[0]) > 2.0 * math.pi:
            raise ValueError(f"limits of {joint.name} are {way:.4g} rad apart; at most a turn, {2.0 * math.pi:.4g} rad")
    if len(handle.workspace) != len(joints):
        along = "x and y" if len(joints) == 2 else "x alone"
        raise ValueError(f"workspace is {_places(handle.workspace)} m; write [low, high] for {along}")
    jacobians, problem = _jacobians(kinematics, joints, handle)
    if problem and len(joints) == 2:
        other = kinematics.model_copy(update={"assembly": -kinematics.assembly})
        tried = {
            f"with assembly {other.assembly}": (other, joints),
            "with the joints swapped": (kinematics, joints[::-1]),
        }
        fits = [told for told, (how, order) in tried.items() if not _jacobians(how, order, handle)[1]]
        problem += f"; {' or '.join(fits)} it fits" if fits else ""
    if problem:
        raise ValueError(problem)
    return jacobians


def turned(joints: tuple[Joint, ...], angles: tuple[float, ...]) -> tuple[float, ...]:
    """Angles as `Joint.turned` has them; but of a pulley, which alone is a single joint, the turns count [rad]."""
    return angles if len(joints) == 1 else tuple(map(Joint.turned, joints, angles))


def beyond(joints: tuple[Joint, ...], angles: tuple[float, ...]) -> str:
    """In words, which joint cannot be at its angle [rad]; "" if all can."""
    for joint, angle in zip(joints, turned(joints, angles), strict=True):
        if not joint.limits[0] <= angle <= joint.limits[1]:
            low, at, high = (f"{math.degrees(each):.4g}°" for each in (joint.limits[0], angle, joint.limits[1]))
            return f"joint {joint.name} is at {at}, and its limits are {low} to {high}"
    return ""


def _jacobians(kinematics: Kinematics, joints: tuple[Joint, ...], handle: Handle) -> tuple[list[Any], str]:
    """The Jacobians of `linkage_of`, and what is wrong with a pose, or ""."""
    found = []
    for place in kinematics.grid(handle.used):
        angles, c = kinematics.angles(*(a + b for a, b in zip(kinematics.origin, place, strict=False)))
        at = ", ".join(f"{axis} = {value:g} m" for axis, value in zip("xy", place, strict=False))
        near = f"the linkage is near a singular pose (a sine of {c:.2g}; at least {CLEAR:g})"
        problem = beyond(joints, angles)
        if c < CLEAR:
            problem = near if c > 0.0 else "the handle cannot be"
            problem += ": check lengths and origin, or take a smaller use_workspace"
        if problem:
            return [], f"the workspace has {at}, where {problem}"
        found.append(kinematics.jacobian(*angles))
    return found, ""


def felt(jacobians: Any, joints: tuple[Joint, ...], handle: Handle | None) -> dict[str, Any]:
    """The least that a linkage's handle feels in any direction where it has these Jacobians (..., n, n).

    Force, friction [N], mass [kg] and damping [N s/m] by their names in Axis. The least d with J⁻ᵀ b J⁻¹ ≽ d, of
    dampings b of the joints, is 1/λ_max(J b⁻¹ Jᵀ).
    """
    import numpy as np  # which a device of axes does without

    longest = np.linalg.norm(jacobians, axis=-2)

    def least(of: list[float]) -> Any:
        return 1.0 / np.linalg.eigvalsh((jacobians / of) @ np.swapaxes(jacobians, -1, -2))[..., -1]

    return {
        "motor_limit": ([joint.limit for joint in joints] / longest).min(axis=-1),
        "coulomb": ([joint.coulomb for joint in joints] / longest).min(axis=-1),
        "mass": (handle.mass if handle else 0.0) + least([joint.inertia for joint in joints]),
        "damping": least([joint.damping for joint in joints]),
    }


def _felt_axes(kinematics: Kinematics, joints: tuple[Joint, ...], handle: Handle) -> list[dict[str, Any]]:
    """x, and y, of a linkage as axes, as they are felt at the worst pose of the workspace that is used."""
    import numpy as np

    jacobians = np.array(linkage_of(kinematics, joints, handle))
    steps = (np.abs(jacobians) * [joint.step for joint in joints]).sum(axis=2).max(axis=0)
    both = {name: float(values.min()) for name, values in felt(jacobians, joints, handle).items()}
    both["velocity_limit"] = handle.velocity_limit
    each = zip("xy", steps.tolist(), handle.used, strict=False)
    return [{"name": name, "counts_per_unit": 1.0 / step, "workspace": along, **both} for name, step, along in each]


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
