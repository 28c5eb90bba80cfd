# SPDX-License-Identifier: Apache-2.0
"""Closed forms of motions: pendulum, rebounding ball, impacts, incline, and what hangs on the coupling alone.

Each takes a case and gives body → poses (n, 3) at the looks, t = 0 included.
"""

import math

import numpy as np
from scipy.special import ellipj, ellipk

from bench.reference.exact_axis import Axis, seen, turning
from haptic_sim.lockstep.error_metrics import Case
from haptic_sim.scene.geometry import turned


def looks(case: Case) -> np.ndarray:
    """Times of the looks [s]."""
    return np.arange(round(case.seconds * 1e9) // case.look + 1) * case.look * 1e-9


def _poses(x, y=0.0, angle=0.0):
    """(n, 3) of coordinates at the looks, or of ones that stay."""
    return np.column_stack(np.broadcast_arrays(x, y, angle))


def pendulum(case: Case) -> dict[str, np.ndarray]:
    """sin(φ/2) = k sn(K + ωt): φ from the lowest place, k = sin(φ₀/2), ω² = m g c/I about the pin; from rest."""
    rod = case.scene.bodies[0]
    mass, inertia, (arm, _) = rod.mass_properties
    rate = math.sqrt(mass * arm * -case.scene.gravity[1] / (inertia + mass * arm * arm))
    start = rod.pose[2] + 0.5 * math.pi
    k = math.sin(0.5 * start)
    sn = ellipj(ellipk(k * k) + rate * looks(case), k * k)[0]
    angle = 2.0 * np.arcsin(k * sn) - 0.5 * math.pi
    return {"rod": _poses(*rod.pose[:2], angle)}


def zeno_ball(case: Case) -> dict[str, np.ndarray]:
    """Parabolas, each of duration e times the one before; at rest after √(2h/g) (1+e)/(1−e)."""
    ball, floor = case.scene.bodies[1], case.scene.bodies[0]
    low = floor.shapes[0].point[1] + ball.shapes[0].radius
    g, e = -case.scene.gravity[1], case.scene.material(ball).restitution
    fall = math.sqrt(2.0 * (ball.pose[1] - low) / g)

    def height(t):
        if t < fall:
            return ball.pose[1] - 0.5 * g * t * t
        began, speed = fall, e * g * fall
        while speed > 1e-9:
            if t < began + 2.0 * speed / g:
                return low + (t - began) * (speed - 0.5 * g * (t - began))
            began, speed = began + 2.0 * speed / g, e * speed
        return low

    return {"ball": np.array([(ball.pose[0], height(t), 0.0) for t in looks(case)])}


def collinear(case: Case) -> dict[str, np.ndarray]:
    """v₁′ = (R − e)/(R + 1) v, v₂′ = R (1 + e)/(R + 1) v from the instant at which the discs meet."""
    striker, struck = case.scene.bodies
    ratio, e, v = striker.mass / struck.mass, case.scene.material(striker).restitution, striker.velocity[0]
    gap = struck.pose[0] - striker.pose[0] - striker.shapes[0].radius - struck.shapes[0].radius
    times, met = looks(case), gap / v
    after = np.maximum(times - met, 0.0)
    first = striker.pose[0] + v * np.minimum(times, met) + (ratio - e) / (ratio + 1.0) * v * after
    second = struck.pose[0] + ratio * (1.0 + e) / (ratio + 1.0) * v * after
    return {"striker": _poses(first), "struck": _poses(second)}


def falling_rod(case: Case) -> dict[str, np.ndarray]:
    """The corner that hits first at speed v gets P = v/(1/m + a²/I), a its level arm; free flight before and after."""
    rod, times = case.scene.bodies[1], looks(case)
    mass, inertia, _ = rod.mass_properties
    corners = [turned(vertex, (0.0, 0.0, rod.pose[2])) for vertex in rod.outlines[0].vertices]
    arm, drop = min(corners, key=lambda corner: corner[1])
    met = (rod.pose[1] + drop) / -rod.velocity[1]
    impulse = -rod.velocity[1] / (1.0 / mass + arm * arm / inertia)
    after = np.maximum(times - met, 0.0)
    height = rod.pose[1] + rod.velocity[1] * times + impulse / mass * after
    return {"rod": _poses(rod.pose[0], height, rod.pose[2] + arm * impulse / inertia * after)}


def incline(case: Case) -> dict[str, np.ndarray]:
    """x = ½ (g sin θ − μ g cos θ) t²."""
    block, times = case.scene.bodies[1], looks(case)
    gx, gy = case.scene.gravity
    way = 0.5 * (gx + case.scene.material(block).friction * gy) * times**2
    return {"block": _poses(block.pose[0] + way, block.pose[1])}


def free_space(case: Case, low: float = -math.inf) -> dict[str, np.ndarray]:
    """Three oscillators led by the hand, the tool under its weight, with a stop on x at `low`."""
    tool = case.scene.tool
    columns = []
    for k, stop in enumerate((low, -math.inf)):
        axis = Axis(tool.mass, *case.gains[:2], 0.0, tool.mass * case.scene.gravity[k], stop)
        columns.append(seen(case, axis, k, tool.pose[k]))
    return {"tool": _poses(*columns, turning(case))}


def wall(case: Case) -> dict[str, np.ndarray]:
    """The same with a stop on x, where the round tool meets the wall."""
    return free_space(case, low=case.scene.tool.shapes[0].radius)


def slider(case: Case) -> dict[str, np.ndarray]:
    """Carriage and tool on the guide as one mass with friction and stops; the tool turns by itself."""
    guide, tool = case.scene.joints[0], case.scene.tool
    both = Axis(tool.mass + case.scene.bodies[0].mass, *case.gains[:2], guide.friction, 0.0, *guide.limits)
    way = seen(case, both, 0, 0.0)
    return {"carriage": _poses(way), "tool": _poses(way, angle=turning(case))}


def slider_free(case: Case) -> dict[str, np.ndarray]:
    """Thrown, no hand: x = v t − ½ (F/m) t² until it rests; short of the stop."""
    guide, tool, times = case.scene.joints[0], case.scene.tool, looks(case)
    slowing, speed = guide.friction / (tool.mass + case.scene.bodies[0].mass), tool.velocity[0]
    times = np.minimum(times, speed / slowing)
    poses = _poses(speed * times - 0.5 * slowing * times**2)
    return {"carriage": poses, "tool": poses}
