# SPDX-License-Identifier: Apache-2.0
"""What the connected device is made of: shaken, estimated axis by axis, written as a description."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from haptic_device.config.description import Axis, Device, Joint, load_device
from haptic_device.config.files import find
from haptic_device.config.yaml_reader import dump
from haptic_device.os_errors import naming
from haptic_device.theory.identify import NAMES, Identified, identify, joint_trace, resolution_of, trace_of
from haptic_device.theory.quantity import positive
from haptic_display.device_tools.excitation import record_excitation
from haptic_display.device_tools.pair import on_pair

SHARE = 0.05  # of the motor's torque, to turn with
FORCE, LINKED = 3.0, 0.2  # [N] to shake with at most; share of it that a linkage can make
STRAIGHT = "x", "y"  # axes that are no turning ones, as theta and all joints are
_COUPLING = ("coupling.stiffness", "coupling.damping", "coupling.rotational_stiffness", "coupling.rotational_damping")
Figures = dict[str, tuple[float, float | None]]
"""Of one axis: name → value and its confidence, if it has one."""
UNITS = {  # of translation, and of rotation
    "mass": ("kg", "kg m²"),
    "damping": ("N s/m", "N m s/rad"),
    "coulomb": ("N", "N m"),
    "bias": ("N", "N m"),
    "delay": ("s", "s"),
    "resolution": ("m", "rad"),
    "residual": ("m", "rad"),
}


def identify_device(
    name: str,
    loopback: str | None,
    seconds: float,
    force: float | None,
    torque: float | None,
    rate: float,
    domain: int | None,
    namespace: str | None,
) -> tuple[dict[str, Figures], Device]:
    """({axis, or joint of a linkage: its figures}, description) of the driver there, or else of a pair started here.

    name, loopback: descriptions of the driver's device, and of the loopback's if it is another (or None); for so long
    [s], with at most so much force [N] and torque [N m]; at this servo rate [Hz]. Raises ValueError, NodeDiedError.
    """
    positive("rate", rate, "Hz")
    described = load_device(name)
    force = _force(described) if force is None else force
    positive("force", force, "N")
    other = load_device(loopback) if loopback else described
    if len(other.axes) != len(described.axes):
        raise ValueError(f"--loopback has {len(other.axes)} axes and --device {len(described.axes)}")
    _refuse_force(described, force)
    torque = _torque(described, torque)
    told = {"device": str(Path(find("devices", name)).absolute()), "servo.rate": rate, **dict.fromkeys(_COUPLING, 0.0)}
    told |= {"fault.silence": 1.0, "fault.unattended": 0.0}  # nobody's hand is at this one
    true = {"device": str(Path(find("devices", loopback or name)).absolute()), **dict.fromkeys(_hand(), 0.0)}
    true["motor_watchdog"] = 1.0
    given = described, seconds, force, torque
    rows = on_pair(domain, namespace, told, true, lambda at, room, check: record_excitation(at, room, check, *given))
    found = {joint.name: estimate_joint(rows, i, described) for i, joint in enumerate(described.joints)}
    for axis in described.axes[len(found) :]:
        found[axis.name] = estimate(rows, len(found), axis)
    return found, described


def _hand() -> tuple[str, ...]:
    parts = ("mass", "damping", "stiffness", "rotational_mass", "rotational_damping", "rotational_stiffness")
    return tuple(f"hand.{part}" for part in parts)


def _force(device: Device) -> float:
    """Largest force of the shaking where none is given [N]."""
    return min([FORCE, *(LINKED * axis.motor_limit for axis in device.axes[: len(device.joints)])])


def _refuse_force(device: Device, force: float) -> None:
    for axis in device.axes[:2]:
        if force > axis.motor_limit:
            raise ValueError(
                f"force is {force:g} N, but the motor of axis {axis.name} gives at most {axis.motor_limit:g} N"
            )


def _torque(device: Device, torque: float | None) -> float | None:
    """Largest torque of the shaking [N m]; None where nothing turns."""
    if len(device.axes) < 3:
        if torque is not None:
            raise ValueError(f"torque is {torque:g} N m, but {device.name} has no theta")
        return None
    limit = device.axes[2].motor_limit
    torque = SHARE * limit if torque is None else torque
    positive("torque", torque, "N m")
    if torque > limit:
        raise ValueError(f"torque is {torque:g} N m, but the motor of axis theta gives at most {limit:g} N m")
    return torque


def estimate(rows: np.ndarray, index: int, axis: Axis) -> Figures:
    """Figures of one axis: name → (value, confidence or None). Raises ValueError, one sentence with the axis's name."""
    per_count = axis.encoder_sign / axis.counts_per_unit
    units = ("rad", "N m", "kg m²") if axis.name == "theta" else ("m", "N", "kg")
    try:
        found = identify(trace_of(rows, index, per_count), axis.mass, axis.damping, units)
        step = resolution_of(rows["counts"][:, index], per_count)
    except ValueError as refusal:
        raise ValueError(f"axis {axis.name}: {refusal}") from None
    return _figures(found, step)


def estimate_joint(rows: np.ndarray, index: int, device: Device) -> Figures:
    """Figures of a linkage's joint, its mass is its inertia without the handle's. Raises ValueError, one sentence."""
    joint: Joint = device.joints[index]
    per_count, handle = joint.encoder_sign * joint.step, device.handle.mass if device.handle else 0.0
    delay, begin = device.sensing_delay + device.actuation_delay, (joint.inertia, joint.damping)
    try:
        for _ in range(2):  # the second time with the delay that was found
            trace, own = joint_trace(rows, index, per_count, device.kinematics, handle, delay)
            found = identify(trace, begin[0] + own, begin[1], ("rad", "N m", "kg m²"))
            delay, begin = found.delay.value, (max(0.0, found.mass.value - own), found.damping.value)
        step = resolution_of(rows["counts"][:, index], per_count)
        if not found.mass.value > own:
            told = f"{found.mass.value:.3g} kg m², less than {handle:g} kg at the handle make there, {own:.3g} kg m²"
            raise ValueError(f"it turns with {told}: write a smaller mass of the handle")
    except ValueError as refusal:
        raise ValueError(f"joint {joint.name}: {refusal}") from None
    return _figures(found._replace(mass=found.mass._replace(value=found.mass.value - own)), step)


def _figures(found: Identified, step: float) -> Figures:
    values: dict[str, Any] = {name: tuple(getattr(found, name)) for name in NAMES}
    return values | {"resolution": (step, None), "residual": (found.residual, None)}


def write_description(path: Path, described: Device, found: dict[str, Figures]) -> None:
    """The description with what was found in it; the confidence stands beside it as comments."""
    delay = max(0.0, _weighted([axis["delay"] for axis in found.values()]))
    content = content_of(described)
    for part in (*content["axes"], *content.get("joints", ())):
        for name in ("mass", "damping", "coulomb"):
            place, digits = ("inertia", 12) if name == "mass" and "inertia" in part else (name, 9)
            part[place] = round(max(0.0, found[part["name"]][name][0]), digits)
    content |= {"name": f"{described.name}_identified", "sensing_delay": 0.0, "actuation_delay": round(delay, 9)}
    lines = [f"#   {axis}: {_line(axis, values)}" for axis, values in found.items()]
    head = "# Identified by haptic identify, ± 95 % confidence. Only the sum of both delays can be told: it stands as\n"
    head += "# actuation_delay.\n"
    with naming(path):
        path.write_text(head + "\n".join(lines) + "\n" + dump(content), encoding="utf-8")


def content_of(device: Device) -> dict[str, Any]:
    """A description as it is written: x and y of a linkage are made of its joints, and others have no joints."""
    if not device.joints:
        return device.model_dump(mode="json", exclude={"kinematics", "joints", "handle"})
    content = device.model_dump(mode="json", exclude_none=True)
    content["axes"] = content["axes"][len(device.joints) :]
    return content


def _weighted(estimates: Iterable[tuple[float, float | None]]) -> float:
    """Mean of values, the surer the heavier."""
    weights = [1.0 / max(confidence or 0.0, 1e-12) ** 2 for _, confidence in estimates]
    return sum(w * value for w, (value, _) in zip(weights, estimates, strict=True)) / sum(weights)


def _line(axis: str, values: Figures) -> str:
    turning = axis not in STRAIGHT
    return ", ".join(f"{name} {figure_text(*pair)} {UNITS[name][turning]}" for name, pair in values.items())


def figure_text(value: float, confidence: float | None) -> str:
    """A figure with its confidence, if it has one."""
    return f"{value:.5g}" if confidence is None else f"{value:.5g} ± {confidence:.2g}"
