# SPDX-License-Identifier: Apache-2.0
"""The operator: where the hand wants the handle to be, and how hard it grips.

A script is a list of waypoints joined by minimum-jerk motions (Flash & Hogan 1985), or a circle. It ends by itself.
"""

import math

import numpy as np

from haptic_device.config.parameters import MOST_WAYPOINTS
from haptic_device.jit import kernel, njit

MOST = MOST_WAYPOINTS + 1  # waypoints with the start
ARM = 0.05  # [m] way that turning by a radian counts as, for the time that it takes
WAYPOINTS, CIRCLE, FOLLOW, PATH = range(4)  # a path is waypoints joined by straight lines
MOTION = np.dtype(
    [
        *(("kind", "i8"), ("count", "i8")),
        ("times", "f8", (MOST,)),  # [s] from the start of the motion, increasing
        ("points", "f8", (MOST, 3)),  # x, y, theta at those times; for a circle the first is the centre
        ("grip", "f8", (MOST,)),  # 1: the hand holds the handle from this waypoint on, 0: it has let go
        *((name, "f8") for name in ("radius", "turns", "duration", "lag")),  # lag: [s] of a followed target
        ("started", "i8"),  # [ns] on the device's clock; 0 = the hand still waits at the first point
    ]
)


def script(values):
    """MOTION record of the script that these parameter values name. Raises ValueError for wrong lengths."""
    for name in ("motion.start", "motion.target"):
        if len(values[name]) != 3:
            raise ValueError(f"{name} has {len(values[name])} numbers; write 3: x, y, theta")
    start, target, name = np.array(values["motion.start"]), np.array(values["motion.target"]), values["motion.name"]
    motion = np.zeros(1, MOTION)
    motion["kind"] = {"circle": CIRCLE, "follow": FOLLOW}.get(name, WAYPOINTS)
    motion["radius"], motion["turns"] = values["motion.radius"], values["motion.turns"]
    motion["lag"], motion["duration"] = values["motion.lag"], values["motion.duration"]
    above = np.array([target[0], start[1], target[2]])
    taps = [(i / values["motion.taps"] / 2, (start, target)[i % 2]) for i in range(2 * values["motion.taps"] + 1)]
    through = _through(start, values["motion.waypoints"]) if name == "waypoints" else []
    points = {
        "waypoints": through,
        "insert_peg": [(0.0, start), (0.2, above), (0.8, target), (1.0, target)],
        "press_wall": [(0.0, start), (0.3, target), (0.7, target), (1.0, start)],
        "tap": taps,
        "let_go": [(0.0, start), (0.4, target), (0.5, target), (1.0, target)],
        "circle": [(0.0, start - [values["motion.radius"], 0.0, 0.0])],
    }.get(name, [(0.0, start), (1.0, start)])
    motion["count"] = len(points)
    for i, (fraction, point) in enumerate(points):
        motion["times"][0, i], motion["points"][0, i] = fraction * values["motion.duration"], point
        motion["grip"][0, i] = 0.0 if name == "let_go" and fraction >= 0.5 else 1.0
    return motion


def _through(start, flat):
    """(share of the time, point) of the start and these waypoints, by the way between them."""
    if not flat or len(flat) % 3:
        raise ValueError(f"motion.waypoints has {len(flat)} numbers; write 3 for each waypoint: x, y, theta")
    if len(flat) > 3 * MOST_WAYPOINTS:
        raise ValueError(f"motion.waypoints names {len(flat) // 3} waypoints; the limit is {MOST_WAYPOINTS}")
    points = np.vstack([start, np.reshape(flat, (-1, 3))])
    ways = np.cumsum(np.linalg.norm(np.diff(points, axis=0) * (1.0, 1.0, ARM), axis=1))
    return list(zip((0.0, *(ways / (ways[-1] or 1.0))), points, strict=True))


def grip_by(plant, values):
    """Puts the hand of these parameter values on a PLANT record."""
    for field in ("mass", "damping", "stiffness"):
        plant[f"hand_{field}"][0, :2] = values[f"hand.{field}"]
        plant[f"hand_{field}"][0, 2] = values[f"hand.rotational_{field}"]


@kernel
def minimum_jerk(fraction):
    """Path fraction 0…1 after this fraction of the time: 10 s³ − 15 s⁴ + 6 s⁵, at rest at both ends."""
    s = min(1.0, max(0.0, fraction))
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


@kernel
def target_at(motion, time, target):
    """Writes where the hand wants the handle at this time [s] of the motion into target (3); returns the grip 0…1."""
    if motion.kind == CIRCLE:
        return _circle(motion, time, target)
    last = 0
    while last + 1 < motion.count and motion.times[last + 1] <= time:
        last += 1
    following = min(last + 1, motion.count - 1)
    span = motion.times[following] - motion.times[last]
    share = min(1.0, (time - motion.times[last]) / span) if span > 0.0 else 0.0
    fraction = share if motion.kind == PATH else minimum_jerk(share)
    for i in range(3):
        start, end = motion.points[last, i], motion.points[following, i]
        target[i] = start + fraction * (end - start)
    return motion.grip[last]


@kernel
def follow(goal, target, lag, elapsed):
    """Next coordinate of a target that runs after a goal set from outside, behind a first-order lag [s]."""
    return goal + (target - goal) * math.exp(-elapsed / lag)


@njit
def _circle(motion, time, target):
    """Circle that starts and ends at its rightmost point, smoothly speeding up and slowing down."""
    angle = 2.0 * math.pi * motion.turns * _eased(time / motion.duration)
    target[0] = motion.points[0, 0] + motion.radius * math.cos(angle)
    target[1] = motion.points[0, 1] + motion.radius * math.sin(angle)
    target[2] = motion.points[0, 2]
    return 1.0


@njit
def _eased(fraction):
    """0…1 with constant rate between a tenth of easing in and a tenth of easing out."""
    s, ease = min(1.0, max(0.0, fraction)), 0.1
    rate = 1.0 / (1.0 - ease)
    if s < ease:
        return rate * s * s / (2.0 * ease)
    if s > 1.0 - ease:
        return 1.0 - rate * (1.0 - s) * (1.0 - s) / (2.0 * ease)
    return rate * (s - ease / 2.0)
