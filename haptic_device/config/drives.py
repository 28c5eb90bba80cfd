# SPDX-License-Identifier: Apache-2.0
"""What the motors of a device drive: its axes, or the joints of a linkage, then theta; and where the handle is then."""

from collections.abc import Sequence
from typing import NamedTuple

from haptic_device.config.description import Device, turned


class Drive(NamedTuple):
    """name: of the axis, or joint (kind); counts: of the encoder per m | rad of the motor; most: of the motor value.

    step: m | rad per count of the encoder, with its sign; zero: position at the count 0; force: N | N m per unit of the
    motor value, with its sign; limit: the most of it.
    """

    name: str
    kind: str
    counts: float
    most: float
    step: float
    zero: float
    force: float
    limit: float


def drives(device: Device) -> tuple[Drive, ...]:
    """The drives of a device, in the order of its counts and motor values."""
    found = []
    for joint in device.joints:
        counts, most = joint.counts_per_rad, joint.torque_limit / joint.torque_constant
        step, force = joint.encoder_sign * joint.step, joint.motor_sign * joint.gear * joint.torque_constant
        found.append(Drive(joint.name, "joint", counts, most, step, joint.zero, force, joint.limit))
    for at in device.axes[len(found) :]:
        counts, most, force = at.counts_per_unit, at.motor_limit / at.motor_constant, at.motor_sign * at.motor_constant
        found.append(Drive(at.name, "axis", counts, most, at.encoder_sign / counts, at.zero, force, at.motor_limit))
    return tuple(found)


def place_of(device: Device, position: Sequence[float]) -> list[float] | None:
    """Handle at the device (x, y, θ) [m, m, rad] at these positions of three drives; None: it cannot be there."""
    if not (count := len(device.joints)):
        return list(position)
    x, y, *_, c = device.kinematics.pose(*position[:count])
    at = device.kinematics.origin
    return [x - at[0], y - at[1] if count > 1 else 0.0, position[2]] if c > 0.0 else None


def drives_at(device: Device, place: Sequence[float]) -> list[float]:
    """Positions of three drives with the handle at this place of the device; the inverse of `place_of`.

    Raises ValueError, one sentence, if the handle cannot be there.
    """
    if not device.joints:
        return list(place)
    at = device.kinematics.origin
    angles, c = device.kinematics.angles(place[0] + at[0], place[1] + at[1])
    if c <= 0.0:
        raise ValueError(f"{device.name} cannot have its handle at x = {place[0]:g} m, y = {place[1]:g} m")
    found = *turned(device.joints, angles), 0.0
    return [found[0], found[1], place[2]]
