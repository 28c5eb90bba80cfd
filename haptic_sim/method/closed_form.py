# SPDX-License-Identifier: Apache-2.0
"""Closed form of a round tool among frictionless flat walls: every axis by itself, one line each.

With the coupling by backward difference, as in `impulse`, an axis u of the tool (mass m) obeys in a sub-step h

    m_e v_free = m (v + h g) + h [K (u_h⁺ − u) + B v_h⁺],      m_e = m + h B + h² K,      u_free = u + h v_free
    u⁺ = clamp(u_free, low, high),      v⁺ = (u⁺ − u)/h,      contact impulse J = m_e (v⁺ − v_free)

The clamp solves the contact exactly: J ≥ 0 away from the wall, gap ≥ 0, and one of the two is zero. It is the resolvent
of a monotone law, so the step is passive for every m, K, B, h: it dissipates ½ m (v⁺ − v)² and what the wall takes. No
wall is passed at any speed. Limits: without walls the free tool; K → ∞ gives clamp(u_h⁺). Which scenes allow it is for
`reduction` to say: walls parallel or square to each other, no friction, no restitution.
"""

import math

import numpy as np

from haptic_device.jit import kernel, njit
from haptic_sim.protocol import STILL, Contact, Coupling, Planar, StepResult, held
from haptic_sim.reduction import ReducedScene
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.shapes import TOOL


class ClosedForm:
    """A round tool among half-planes, stepped by `sub_step` [s]. Implements `World`; ValueError for other scenes."""

    passive, inner = True, 1

    def __init__(self, reduced: ReducedScene, sub_step: float):
        axes, scene = reduced.needs.axes, reduced.scene
        if axes is None:
            raise ValueError(f"scene {scene.name!r} has no closed form; take another method")
        self.scene, self.sub_step = scene, sub_step
        self._x, self._y = axes[0] if axes else (1.0, 0.0)
        self._walls = [_walls(scene, axis) for axis in ((self._x, self._y), (-self._y, self._x))]
        low = *(low for (low, _), _ in self._walls), -math.inf
        high = *(high for _, (high, _) in self._walls), math.inf
        mass, inertia, _ = scene.tool.mass_properties
        self._settings = (mass, mass, inertia), self._turned((*scene.gravity, 0.0)), low, high, sub_step
        self.couple(Coupling())
        self.reset()
        self.step(held(self.position), 0)  # compiled here, not in the first exchange

    def reset(self) -> None:
        """Everything back to the scene's start, with the same gains."""
        tool = self.scene.tool
        self.position: Planar = tool.pose
        self.velocity: Planar = tool.velocity
        self.force_on_tool: Planar = STILL
        self.touching = False
        self._state = self._turned(tool.pose), self._turned(tool.velocity), STILL, STILL

    def couple(self, coupling: Coupling) -> None:
        """Take these gains from the next sub-step on; ValueError if one is negative or not finite."""
        stiffness, damping, turning_stiffness, turning_damping = map(float, coupling.checked())
        self._stiffness, self._damping = (stiffness, stiffness, turning_stiffness), (damping, damping, turning_damping)

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """Advance `n` sub-steps from each row of the handle's way (m, 6: position, velocity) evenly to the next."""
        axes = self._x, self._y
        return self._take(advance(*self._state[:2], axes, target, self._stiffness, self._damping, self._settings, n))

    def _take(self, found):
        place, rate, force, push, supplied, most, taken = found
        self._state = place, rate, force, push
        self.position, self.velocity, self.force_on_tool = self._plane(place), self._plane(rate), self._plane(force)
        self.touching = push[0] != 0.0 or push[1] != 0.0
        return StepResult(supplied, most > 0.0, most, 0.0, contacts=taken)

    def contacts(self) -> list[Contact]:
        """Contacts of the last sub-step, sorted by bodies and place."""
        return sorted(self._contact(k) for k in (0, 1) if self._state[3][k])

    def bodies(self) -> list[tuple[Planar, Planar]]:
        """Pose and velocity of the tool, which is all that moves."""
        return [(self.position, self.velocity)]

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame at the end of the sub-step."""
        return self.position if body == TOOL else next(fixed.pose for fixed in self.scene.bodies if fixed.name == body)

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of the tool [J]; potential is 0 at the origin."""
        (x, y, angle), (vx, vy, turn), *_ = self._state
        (mass, _, inertia), (gx, gy, twist), *_ = self._settings
        kinetic = 0.5 * (mass * (vx * vx + vy * vy) + inertia * turn * turn)
        return kinetic, -mass * (gx * x + gy * y + twist * angle)

    def _turned(self, vector):
        """From the plane's axes to those of the walls."""
        x, y, theta = vector
        return self._x * x + self._y * y, self._x * y - self._y * x, float(theta)

    def _plane(self, vector):
        u, w, theta = vector
        return self._x * u - self._y * w, self._y * u + self._x * w, theta

    def _contact(self, k):
        push = self._state[3][k]
        sign = math.copysign(1.0, push)
        axis = ((self._x, self._y), (-self._y, self._x))[k]
        normal = -sign * axis[0], -sign * axis[1]
        radius = _radius(self.scene)
        point = self.position[0] + radius * normal[0], self.position[1] + radius * normal[1]
        wall = self._walls[k][push < 0.0][1]
        return Contact(TOOL, wall, point, normal, (push * axis[0], push * axis[1]), 0.0)


@njit
def _advance(place, rate, p0, v0, p1, v1, stiffness, damping, mass, gravity, low, high, h, count):
    """Places, rates, forces of coupling and walls; energy supplied; the walls' largest force; energy they took."""
    x, y, t = (place[0], rate[0], 0.0, 0.0), (place[1], rate[1], 0.0, 0.0), (place[2], rate[2], 0.0, 0.0)
    supplied = most = taken = 0.0
    for k in range(1, count + 1):
        s = k / count
        r = 1.0 - s
        handle = r * p0[0] + s * p1[0], r * p0[1] + s * p1[1], r * p0[2] + s * p1[2]
        velocity = r * v0[0] + s * v1[0], r * v0[1] + s * v1[1], r * v0[2] + s * v1[2]
        given = handle, velocity, stiffness, damping, mass, gravity, low, high, h
        past_x, past_y, past_t = x[0], y[0], t[0]
        rate_x, rate_y = x[1], y[1]
        x, y, t = _axis(0, x, *given), _axis(1, y, *given), _axis(2, t, *given)
        supplied += x[2] * (x[0] - past_x) + y[2] * (y[0] - past_y) + t[2] * (t[0] - past_t)
        most = max(most, max(abs(x[3]), abs(y[3])))
        taken -= 0.5 * h * (x[3] * (rate_x + x[1]) + y[3] * (rate_y + y[1]))
    return (x[0], y[0], t[0]), (x[1], y[1], t[1]), (x[2], y[2], t[2]), (x[3], y[3], t[3]), supplied, most, taken


@kernel
def advance(place, rate, axes, path, stiffness, damping, settings, count):
    """`_advance` from each row of a path in the plane to the next."""
    force = push = (0.0, 0.0, 0.0)
    supplied = most = taken = 0.0
    for k in range(len(path) - 1):
        ends = (_on(axes, path[k], 0), _on(axes, path[k], 3), _on(axes, path[k + 1], 0), _on(axes, path[k + 1], 3))
        place, rate, force, push, given, pressed, lost = _advance(
            place, rate, *ends, stiffness, damping, *settings, count
        )
        supplied, most, taken = supplied + given, max(most, pressed), taken + lost
    return place, rate, force, push, supplied, most, taken


@njit
def _on(axes, row, at):
    """Three numbers of a row, turned from the plane's axes to those of the walls."""
    x, y = axes
    return x * row[at] + y * row[at + 1], x * row[at + 1] - y * row[at], row[at + 2]


@njit
def _axis(i, start, handle, handle_rate, stiffness, damping, mass, gravity, low, high, h):
    """Axis i after a sub-step: place, rate, force of the coupling and mean force of the wall on the tool."""
    place, rate = start[0], start[1]
    effective = mass[i] + h * (damping[i] + h * stiffness[i])
    push = stiffness[i] * (handle[i] - place) + damping[i] * handle_rate[i]
    new_rate, wall = (mass[i] * (rate + h * gravity[i]) + h * push) / effective, 0.0
    new_place = place + h * new_rate
    if not low[i] <= new_place <= high[i]:
        new_place = low[i] if new_place < low[i] else high[i]
        held = (new_place - place) / h
        wall, new_rate = effective * (held - new_rate) / h, held
    force = stiffness[i] * (handle[i] - new_place) + damping[i] * (handle_rate[i] - new_rate)
    return new_place, new_rate, force, wall


def _walls(scene, axis):
    """(least, name of the wall there), (most, name): where the tool's centre can be along an axis [m]."""
    low, high = (-math.inf, ""), (math.inf, "")
    radius = _radius(scene)
    for body in scene.bodies:
        for shape in body.shapes if body.layers & scene.tool.layers else ():
            (nx, ny), (px, py) = shape.normal, turned(shape.point, body.pose)
            along = sum(a * b for a, b in zip(turned((nx, ny), (0.0, 0.0, body.pose[2])), axis, strict=True))
            face = px * axis[0] + py * axis[1]
            if along > 0.5 * math.hypot(nx, ny):
                low = max(low, (face + radius, body.name))
            elif along < -0.5 * math.hypot(nx, ny):
                high = min(high, (face - radius, body.name))
    return low, high


def _radius(scene):
    return max(outline.radius for outline in scene.tool.outlines)
