# SPDX-License-Identifier: Apache-2.0
"""What a linkage's handle feels of its joints at one pose, in the worst direction there.

A spring K and a damper B in any direction of the plane are passive at a pose with Jacobian J where

    Jᵀ (K T/2 + |B|) J ≼ b_joints,      that is K T/2 + |B| ≤ b = 1/λ_max(J b_joints⁻¹ Jᵀ)                         (1)

so the condition of one axis (Colgate & Schenkel 1997) stands with this b.
"""

import math
import operator
from typing import Any, NamedTuple

import numpy as np

from haptic_device.config.description import Device, beyond, felt, turned
from haptic_device.digits import plain
from haptic_device.theory.quantity import Array, positive


class Felt(NamedTuple):
    """A pose of a linkage of n joints, and what is felt there at the handle.

    Attributes:
        joints: angles [rad], n.
        position: of the handle, in the linkage's frame [m], n.
        singular: c, how far from singular the pose is (config/kinematics).
        jacobian: ∂position/∂joints [m/rad], (n, n).
        matrix: damping J⁻ᵀ b J⁻¹ [N s/m], (n, n).
        damping, mass, coulomb: the least in any direction [N s/m, kg, N].
        step: the largest of the encoders in any direction [m].
    """

    joints: tuple[float, ...]
    position: tuple[float, ...]
    singular: float
    jacobian: Array
    matrix: Array
    damping: float
    mass: float
    coulomb: float
    step: float

    @property
    def told(self) -> str:
        """The pose in words."""
        joints = ", ".join(f"{plain(math.degrees(angle), digits=4)}°" for angle in self.joints)
        place = ", ".join(f"{axis} = {value:.4g}" for axis, value in zip("xy", self.position, strict=False))
        return f"joints at {joints}, handle at {place} m from the first motor"

    @property
    def values(self) -> dict[str, Any]:
        """The pose as JSON has it, joints in degrees."""
        known = {"joints": np.degrees(self.joints).tolist(), "position": list(self.position)}
        return {**known, "damping": self.matrix.tolist(), "singular": self.singular}


def damped(device: Device, damping: float) -> Device:
    """A linkage with this damping of each joint [N m s/rad]. Raises ValueError if it is not greater than 0."""
    positive("physical_damping", damping, "N m s/rad")
    return device.model_copy(
        update={"joints": tuple(joint.model_copy(update={"damping": damping}) for joint in device.joints)}
    )


def figures(device: Device, pose: Felt | None) -> dict[str, float]:
    """Damping, mass, friction and encoder step of a device as a Display names them; of a linkage at this pose."""
    of, step = pose or device.axes[0], pose.step if pose else 1.0 / device.axes[0].counts_per_unit
    return {"physical_damping": of.damping, "mass": of.mass, "coulomb": of.coulomb, "resolution": step}


def delays(device: Device, period: float) -> dict[str, float]:
    """What of a device's delays a Display needs, in periods [s], and what is not known of a sample's time [s]."""
    late = device.sensing_delay + device.actuation_delay
    return {"delay_samples": late / period if period > 0.0 else 0.0, "stamp_error": device.stamp_error}


def felt_at(device: Device, joints: str | None = None, position: str | None = None) -> Felt:
    """What is felt at a pose, or at the worst of the workspace that is used.

    Raises ValueError with one sentence for a pose that cannot be.

    Args:
        device: with a linkage.
        joints: angles in degrees, as `120,60`.
        position: place of the handle in the linkage's frame in metres, as `0.02,0.13`.

    Examples:
        >>> from haptic_device.config.description import load_device
        >>> from haptic_device.theory.felt import felt_at
        >>> pose = felt_at(load_device("haply_2diy_gen3"), joints="120,60")
        >>> print(round(2.0 * pose.damping / 0.001, 2))  # K of a passive spring at 1 kHz: 2 b/(T σ²)
        34.75
    """
    kinematics = device.kinematics
    if joints is None and position is None:
        origin, places = kinematics.origin[: kinematics.joints], kinematics.grid(device.used)
        found = (kinematics.angles(*map(operator.add, place, origin))[0] for place in places)
        return min((_felt(device, angles) for angles in found), key=lambda pose: pose.damping)
    name, given, unit = ("joints", joints, "degrees") if position is None else ("position", position, "m")
    numbers = _numbers(name, given or "", unit, kinematics.joints)
    angles = tuple(map(math.radians, numbers))
    angles, c = (angles, kinematics.pose(*angles)[-1]) if position is None else kinematics.angles(*numbers)
    if c <= 1e-6:
        raise ValueError(f"{name} is {given} {unit}; the handle of {device.name} cannot be there")
    if problem := beyond(device.joints, angles):
        raise ValueError(f"{name} is {given} {unit}; {problem}")
    return _felt(device, angles if position is None else turned(device.joints, angles))


def _felt(device: Device, angles: tuple[float, ...]) -> Felt:
    x, y, *_, c = device.kinematics.pose(*angles)
    jacobian, joints = np.array(device.kinematics.jacobian(*angles)), device.joints
    inverse, steps = np.linalg.inv(jacobian), jacobian * [joint.step for joint in joints]
    least = felt(jacobian, joints, device.handle)
    return Felt(
        joints=angles,
        position=tuple(map(float, (x, y)[: len(angles)])),
        singular=c,
        jacobian=jacobian,
        matrix=inverse.T @ np.diag([joint.damping for joint in joints]) @ inverse,
        **{name: float(least[name]) for name in ("damping", "mass", "coulomb")},
        step=float(max(np.linalg.norm(steps[:, 0] + sign * steps[:, 1:].sum(axis=1)) for sign in (1.0, -1.0))),
    )


def _numbers(name: str, given: str, unit: str, count: int) -> list[float]:
    try:
        numbers = [float(part) for part in given.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        wanted = f"two numbers A,B in {unit} are" if count == 2 else f"a number in {unit} is"
        raise ValueError(f"{name} is {given!r}; {wanted} needed")
    return numbers
