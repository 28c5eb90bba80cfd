# SPDX-License-Identifier: Apache-2.0
"""The motion that a scene suggests to the hand, as parameters have it. Needs no library: the launch file has none."""

from typing import Any


def flat_motion(motion: dict[str, Any]) -> dict[str, Any]:
    """A motion as the hand's parameters have it: waypoints [x, y] or [x, y, theta] behind each other, as x, y, theta.

    One without theta keeps that of the start. Raises ValueError for waypoints of another length.
    """
    points = motion.get("waypoints")
    if not isinstance(points, list) or not any(isinstance(point, list) for point in points):
        return motion
    start = motion.get("start")
    turned = start[2] if isinstance(start, list) and len(start) == 3 else 0.0
    for i, point in enumerate(points):
        if not isinstance(point, list) or len(point) not in (2, 3):
            raise ValueError(f"waypoints[{i}] is {point}; write [x, y] or [x, y, theta]")
    return {**motion, "waypoints": [number for point in points for number in (*point, turned)[:3]]}
