# SPDX-License-Identifier: Apache-2.0
"""What a page draws of a linkage: where its motors stand, how long its links are, and how far it reaches."""

import math
from functools import lru_cache
from typing import Any

from haptic_device.config.description import Device
from haptic_device.config.kinematics import LENGTHS, NEEDS, Kinematics

RAYS, STEPS, HALVES = 120, 100, 24  # of the search for the reach: directions, steps along each, and halves of the last
Place = tuple[float, float]


def linkage_facts(device: Device | None) -> dict[str, Any] | None:
    """Of a device with joints, lengths and places in the world [m]; None of another.

    arms: motor, and side of the elbow (1: to the left of the way from the motor to the handle). sector: pivot and radii
    of handle, sector and pulley, or None. workspace: the one that is used, [low, high] of each axis. reach: as `reach`.
    """
    if not device or not device.handle:
        return None
    kinematics, scale, origin, used = device.kinematics, device.scale[0], device.kinematics.origin, device.handle.used

    def world(places: list[Place]) -> list[list[float]]:
        return [[scale * (x - origin[0]), scale * (y - origin[1])] for x, y in places]

    lengths = {name: scale * (getattr(kinematics, name) or 0.0) for name in LENGTHS}
    motors, sector = world([(x, 0.0) for x in kinematics.motors]), None
    sides = [1, -1] if len(motors) == 2 else [-1]
    if not motors:
        pivot = world([(0.0, origin[1] - (kinematics.handle_radius or 0.0))])[0]
        sector = {"pivot": pivot, "radii": [lengths[name] for name in NEEDS["sector_pulley"]]}
    middle = tuple(at + sum(along) / 2.0 for at, along in zip(origin, used, strict=False))
    return {
        "arms": [{"motor": at, "side": side * kinematics.assembly} for at, side in zip(motors, sides, strict=False)],
        "proximal": lengths["proximal"],
        "distal": lengths["distal"],
        "sector": sector,
        "workspace": [[scale * low, scale * high] for low, high in used],
        "reach": world(reach(kinematics, middle) if motors else []),
    }


@lru_cache(maxsize=8)
def reach(kinematics: Kinematics, middle: tuple[float, ...]) -> list[Place]:
    """The singular curve about a place of the linkage's frame [m]: in each direction where c has come to 0."""
    far = 2.0 * ((kinematics.proximal or 0.0) + (kinematics.distal or 0.0)) / STEPS  # of a step

    def can(angle: float, way: float) -> bool:
        return kinematics.angles(middle[0] + way * math.cos(angle), middle[1] + way * math.sin(angle))[1] > 0.0

    found = []
    for ray in range(RAYS):
        angle = 2.0 * math.pi * (ray + 0.5) / RAYS  # along no axis: one place that is singular is no edge
        high = next((far * step for step in range(1, STEPS) if not can(angle, far * step)), far * STEPS)
        low = high - far
        for _ in range(HALVES):
            half = 0.5 * (low + high)
            low, high = (half, high) if can(angle, half) else (low, half)
        found.append((middle[0] + low * math.cos(angle), middle[1] + low * math.sin(angle)))
    return found
