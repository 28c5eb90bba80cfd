# SPDX-License-Identifier: Apache-2.0
"""Joints of a scene as Chipmunk's constraints, and the energy that their springs hold.

A slider. Since its bodies do not turn against each other, its guide may be held at any point, and what acts along it
may act at any point. The point matters to Chipmunk: its groove asks for the impulse J with n · K⁻¹ (v + K J) = 0, where
K is what an impulse at the point does to the velocity there, so that n · v = 0 only where K does not mix n with the
axis t. With arms r_a, r_b from the mass centres, K mixes them by (r_a · n)(r_a · t)/I_a + (r_b · n)(r_b · t)/I_b, which
is 0 wherever the bodies are if the point is level with the mass centre of b along t, and with that of a along n. The
guide's impulses then turn a alone, so a is the one of more inertia.

What acts along the axis is held by a point `REACH` behind or ahead on it: the distance of two points has no sign, but
that to a point so far away grows with the coordinate, and its line is the axis.

A damper, by backward difference, gives the impulse −h c v⁺. Chipmunk's takes the share 1 − exp(−C h/m) of the velocity
v between its ends, m being their mass as seen there, while others push: with C = m/h ln(1 + c h/m) what is left is
v⁺ = (v + J/m)/(1 + c h/m), which is that. It is stable for every c h/m; the same with I, c_θ.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pymunk

from haptic_sim.reduction import ReducedScene
from haptic_sim.reduction.model import PIN, SPRING, Model
from haptic_sim.scene.geometry import Point, Pose, framed, turned

REACH = 1e4
"""m; how far away the point is that holds what acts along an axis. A spring of two axes errs by y²/2 REACH."""
STOP_BIAS = 1e-3
"""As a space's collision_bias, for joints with a stop: Chipmunk takes their error back as velocity, which stays."""
REACHED, BEYOND = 1e-9, -0.5e-9
"""m | rad by which a stop is passed when it is reached: Chipmunk's acts beyond alone. The way left of a passed one."""
MANY, MANY_BIAS = 12, 1e-20
"""For more joints than this: so many velocities are not settled within the sweeps, and a grid of 17 pins blows up."""
ALONE_BIAS = 0.0
"""All at once, of the only joint of two free bodies, or of one with a stop: ends that are apart push past each other,
and what that turns bodies by stays. In a chain it would blow up."""


class Damper(NamedTuple):
    """A Chipmunk spring, the damping that it stands for, and whether its lever arms change."""

    spring: pymunk.DampedSpring | pymunk.DampedRotarySpring
    damping: float
    turns: bool

    def set_for(self, h: float) -> None:
        """Makes the spring damp a step of h [s] by backward difference, with the bodies as they are now."""
        mobility = self._mobility()
        self.spring.damping = math.log1p(h * self.damping * mobility) / (h * mobility)

    def _mobility(self) -> float:
        spring, a, b = self.spring, self.spring.a, self.spring.b
        if isinstance(spring, pymunk.DampedRotarySpring):
            return 1.0 / a.moment + 1.0 / b.moment
        on_a, on_b = a.local_to_world(spring.anchor_a), b.local_to_world(spring.anchor_b)
        line = (on_b - on_a).normalized()
        arms = (on_a - a.position).cross(line), (on_b - b.position).cross(line)
        return sum(1.0 / end.mass + arm * arm / end.moment for end, arm in zip((a, b), arms, strict=True))


class Stop(NamedTuple):
    """The limits of a joint's coordinate, and a movable body of it, which no other joint holds."""

    joint: pymunk.RotaryLimitJoint | pymunk.SlideJoint
    body: int

    def ahead(self) -> tuple[float, float]:
        """Way left to the limit that the coordinate goes to, and its rate towards it [m, m/s | rad, rad/s]."""
        joint, a, b = self.joint, self.joint.a, self.joint.b
        if isinstance(joint, pymunk.RotaryLimitJoint):
            at, rate = b.angle - a.angle, b.angular_velocity - a.angular_velocity
        else:
            on_a, on_b = a.local_to_world(joint.anchor_a), b.local_to_world(joint.anchor_b)
            line, at = (on_b - on_a).normalized_and_length()
            rate = (b.velocity_at_world_point(on_b) - a.velocity_at_world_point(on_a)).dot(line)
        return (joint.max - at, rate) if rate > 0.0 else (at - joint.min, -rate)

    def time_left(self) -> float:
        """Time [s] until the coordinate is at a limit, at its present rate; inf beyond it."""
        way, rate = self.ahead()
        return (way + REACHED) / rate if way > BEYOND and rate > 0.0 else math.inf


class Tended(NamedTuple):
    """What of the joints has to be looked after."""

    dampers: list[Damper]
    stops: list[Stop]


def add_joints(space: pymunk.Space, reduced: ReducedScene, bodies: list[pymunk.Body]) -> Tended:
    """All joints of the model; `bodies` are the model's movable ones in its order."""
    model, tended = reduced.model, Tended([], [])
    for j, ends in enumerate(model.joint_bodies.tolist()):
        a, b = (bodies[k] if k < len(bodies) else space.static_body for k in ends)
        for joint in _joint(model, j, a, b, _bias(space, model, j)):
            space.add(joint)
            if isinstance(joint, pymunk.RotaryLimitJoint | pymunk.SlideJoint) and _is_alone(model, j):
                tended.stops.append(Stop(joint, min(ends)))
            if isinstance(joint, pymunk.DampedSpring | pymunk.DampedRotarySpring) and model.joint_spring[j, 1] > 0.0:
                damper = Damper(joint, float(model.joint_spring[j, 1]), bool(model.joint_kind[j] == SPRING))
                tended.dampers.append(damper)
    return tended


def _bias(space: pymunk.Space, model: Model, j: int) -> float:
    """How fast the errors of joint j are taken back."""
    stopped = np.isfinite(model.joint_limit[j]).any()
    if _is_alone(model, j) and (stopped or not model.fixed[model.joint_bodies[j]].any()):
        return ALONE_BIAS
    return STOP_BIAS if stopped else MANY_BIAS if len(model.joint_kind) > MANY else space.collision_bias


def _is_alone(model: Model, j: int) -> bool:
    """Whether no other joint than joint j, springs left out, holds one of its bodies that can move."""
    held = {body for body in model.joint_bodies[j].tolist() if not model.fixed[body]}
    others = np.delete(model.joint_bodies, j, axis=0)[np.delete(model.joint_kind, j) != SPRING]
    return not held & set(others.flatten().tolist())


def _joint(model: Model, j: int, a: pymunk.Body, b: pymunk.Body, bias: float) -> Iterator[pymunk.Constraint]:
    """Chipmunk's constraints that make one joint of the model."""
    if model.joint_kind[j] == PIN:
        return _pin(model, j, a, b, bias)
    return _spring(model, j, a, b) if model.joint_kind[j] == SPRING else _slider(model, j, (a, b), bias)


def _pin(model: Model, j: int, a: pymunk.Body, b: pymunk.Body, bias: float) -> Iterator[pymunk.Constraint]:
    start, (low, high) = float(model.joint_angle[j]), model.joint_limit[j].tolist()
    stiffness, damping, rest = model.joint_spring[j].tolist()
    yield _biased(pymunk.PivotJoint(a, b, *model.joint_anchor[j].tolist()), bias)
    if math.isfinite(low) or math.isfinite(high):
        yield _biased(pymunk.RotaryLimitJoint(a, b, start + low, start + high), STOP_BIAS)
    if stiffness or damping:
        yield pymunk.DampedRotarySpring(a, b, -(start + rest), stiffness, damping)
    for speed, most in _drives(model, j):
        motor = pymunk.SimpleMotor(a, b, -speed)  # Chipmunk's rate is that of a against b
        motor.max_force = most
        yield motor


def _slider(model: Model, j: int, bodies: tuple[pymunk.Body, pymunk.Body], bias: float) -> Iterator[pymunk.Constraint]:
    first, on_b, behind, ahead = _ends(model, j)
    a, b = bodies[first], bodies[1 - first]
    low, high = model.joint_limit[j].tolist()
    stiffness, damping, rest = model.joint_spring[j].tolist()
    angle = float(model.joint_angle[j])
    yield _biased(pymunk.GrooveJoint(a, b, behind, ahead, on_b), bias)
    yield _biased(pymunk.GearJoint(a, b, -angle if first else angle, 1.0), bias)
    if math.isfinite(low) or math.isfinite(high):
        yield _biased(pymunk.SlideJoint(a, b, behind, on_b, REACH + max(low, -REACH), REACH + high), STOP_BIAS)
    if stiffness or damping:
        yield pymunk.DampedSpring(a, b, behind, on_b, REACH + rest, stiffness, damping)
    for speed, most in _drives(model, j):
        drive = pymunk.PinJoint(a, b, behind if speed < 0.0 else ahead, on_b)
        drive.max_force, drive.distance = most, 0.0
        drive.max_bias, drive.error_bias = abs(speed), 0.0  # it never gets there, at that speed
        yield drive


def _ends(model: Model, j: int) -> tuple[int, Point, Point, Point]:
    """Which of a slider's bodies has the guide; where the other is held; points of the guide far behind and ahead.

    The guide is in the body of more inertia, which its impulses turn; the coordinate is the same from either.
    """
    ends = model.joint_bodies[j]
    first = int(model.inertia[ends[1]] > model.inertia[ends[0]])
    a, b = ends[first], ends[1 - first]
    frame_a, frame_b = (tuple(model.pose[body].tolist()) for body in (a, b))
    ux, uy = turned(model.joint_axis[j].tolist(), (0.0, 0.0, float(model.pose[ends[0], 2] - model.pose[a, 2])))
    axis = (-ux, -uy) if first else (ux, uy)
    x, y = framed(frame_b[:2], frame_a)
    way = x * axis[0] + y * axis[1]
    on_a = (x, y) if model.fixed[a] else (way * axis[0], way * axis[1])
    behind, ahead = ((on_a[0] + far * axis[0], on_a[1] + far * axis[1]) for far in (-REACH, REACH))
    return first, framed(turned(on_a, frame_a), frame_b), behind, ahead


def _spring(model: Model, j: int, a: pymunk.Body, b: pymunk.Body) -> Iterator[pymunk.Constraint]:
    """A spring along the line between its anchors; without length, one along each of two axes of a."""
    (stiffness, damping, rest), (on_a, on_b) = model.joint_spring[j].tolist(), model.joint_anchor[j].tolist()
    if rest > 0.0:
        yield pymunk.DampedSpring(a, b, on_a, on_b, rest, stiffness, damping)
    else:
        for x, y in ((REACH, 0.0), (0.0, REACH)):
            yield pymunk.DampedSpring(a, b, (on_a[0] - x, on_a[1] - y), on_b, REACH, stiffness, damping)


def _drives(model: Model, j: int) -> list[tuple[float, float]]:
    """Speed and greatest force of a joint's motor and of its dry friction."""
    speed, strength = model.joint_motor[j].tolist()
    return [pair for pair in ((speed, strength), (0.0, float(model.joint_friction[j]))) if pair[1] > 0.0]


def _biased(joint: pymunk.Constraint, bias: float) -> pymunk.Constraint:
    joint.error_bias = bias
    return joint


def stored(model: Model, poses: Sequence[Pose]) -> float:
    """Energy in the springs of all joints [J], bodies at `poses` (mass centre, angle)."""
    return sum(
        0.5 * spring[0] * _stretch(model, j, (*poses, (0.0, 0.0, 0.0))) ** 2
        for j, spring in enumerate(model.joint_spring.tolist())
        if spring[0] > 0.0
    )


def _stretch(model: Model, j: int, poses: Sequence[Pose]) -> float:
    a, b = (poses[k] for k in model.joint_bodies[j])
    if model.joint_kind[j] == PIN:
        return b[2] - a[2] - model.joint_angle[j] - model.joint_spring[j, 2]
    on_a, on_b = (turned(tuple(anchor), pose) for anchor, pose in zip(model.joint_anchor[j], (a, b), strict=True))
    if model.joint_kind[j] == SPRING:
        return math.dist(on_a, on_b) - model.joint_spring[j, 2]
    ux, uy = turned(tuple(model.joint_axis[j]), (0.0, 0.0, a[2]))
    return ux * (on_b[0] - on_a[0]) + uy * (on_b[1] - on_a[1]) - model.joint_spring[j, 2]
