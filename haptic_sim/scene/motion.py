# SPDX-License-Identifier: Apache-2.0
"""The motion that a scene suggests to the hand, as parameters have it. Needs no library: the launch file has none."""

import math
from collections.abc import Sequence
from typing import Any

Place = tuple[float, float, float]
CORNERS = 24  # of the polygon that a turn of a circle is drawn as
MOST_TURNS = 20  # and taps that are shown
SECONDS = 4.0  # of a motion that does not say how long it takes


def flat_motion(motion: dict[str, Any]) -> dict[str, Any]:
    """A motion as parameters have it: decimal numbers, but for `taps`; waypoints [x, y] or [x, y, theta] in one list.

    A waypoint without theta keeps that of the start. Raises ValueError for waypoints of another length.
    """
    points, start = motion.get("waypoints"), motion.get("start")
    if isinstance(points, list) and any(isinstance(point, list) for point in points):
        turned = start[2] if isinstance(start, list) and len(start) == 3 else 0.0
        for i, point in enumerate(points):
            if not isinstance(point, list) or len(point) not in (2, 3):
                raise ValueError(f"waypoints[{i}] is {point}; write [x, y] or [x, y, theta]")
        motion = {**motion, "waypoints": [number for point in points for number in (*point, turned)[:3]]}
    return {key: value if key == "taps" else _decimal(value) for key, value in motion.items()}


def _decimal(value: Any) -> Any:
    if isinstance(value, list):
        return [_decimal(item) for item in value]
    return float(value) if type(value) is int and value.bit_length() < 64 else value


def way_of(motion: dict[str, Any], pose: Place) -> tuple[Place, ...]:
    """Places [m, m, rad] that a motion leads through, a flat one as above; pose: where it begins unless it says so.

    Only the way there: what comes back at its end is left out, but between taps. TypeError, ValueError or OverflowError
    for a motion that no hand would take.
    """
    start, name = _place(motion.get("start", pose)), motion.get("name")
    target = _place(motion.get("target", start))
    if name == "waypoints":
        flat = motion.get("waypoints", [])
        return (start, *(_place(flat[i : i + 3]) for i in range(0, len(flat) - 2, 3)))
    if name == "circle":
        return tuple(_circle(start, motion.get("radius", 0.03), motion.get("turns", 1.0)))
    if name == "tap":
        return (start, target) * min(MOST_TURNS, max(1, int(motion.get("taps", 1))))
    if name == "insert_peg":
        return start, (target[0], start[1], target[2]), target
    return (start, target) if target != start else (start,)


def seconds_of(motion: dict[str, Any]) -> float:
    """How long a motion takes [s]; TypeError or ValueError for what is no time."""
    seconds = float(motion.get("duration", SECONDS))
    if not 0.0 < seconds < math.inf:
        raise ValueError(f"duration is {seconds}")
    return seconds


def _place(numbers: Sequence[float]) -> Place:
    x, y, theta = map(float, numbers)
    if not math.isfinite(x + y + theta):
        raise ValueError(f"{list(numbers)} is no place")
    return x, y, theta


def _circle(start: Place, radius: float, turns: float) -> list[Place]:
    """`start` is its rightmost point."""
    turns = math.copysign(min(MOST_TURNS, abs(turns)), turns)
    count = max(1, math.ceil(CORNERS * abs(turns)))
    angles = [2.0 * math.pi * turns * k / count for k in range(count + 1)]
    return [(start[0] + radius * (math.cos(a) - 1.0), start[1] + radius * math.sin(a), start[2]) for a in angles]
