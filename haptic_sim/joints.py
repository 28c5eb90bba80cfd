# SPDX-License-Identifier: Apache-2.0
"""Joints of a scene as Chipmunk's constraints, and the energy that their springs hold."""

import math

import numpy as np
import pymunk

from haptic_sim.geometry import turned
from haptic_sim.reduction import ReducedScene
from haptic_sim.reduction.model import PIN, SLIDER, SPRING

REACH = 100.0
"""m; half the length of a groove without limits."""
STOP_BIAS = 1e-3
"""As a space's collision_bias, for joints with a stop: Chipmunk takes a joint's error back as velocity, which stays."""
MANY, MANY_BIAS = 12, 1e-20
"""For more joints than this: so many velocities are not settled within the sweeps, and a grid of 17 pins blows up."""


def add_joints(space: pymunk.Space, reduced: ReducedScene, bodies: list[pymunk.Body]) -> None:
    """All joints of the model; `bodies` are the model's movable ones in its order."""
    bias = MANY_BIAS if len(reduced.model.joint_kind) > MANY else space.collision_bias
    for j in range(len(reduced.model.joint_kind)):
        for joint in _joint(reduced.model, j, [*bodies, space.static_body]):
            stops = np.any(np.isfinite(reduced.model.joint_limit[j]))
            if joint.max_bias > 1e9:  # else a drive, which has no error
                joint.error_bias = STOP_BIAS if stops else bias
            space.add(joint)


def _joint(model, j, bodies):
    """Chipmunk's constraints that make one joint of the model."""
    a, b = (bodies[k] for k in model.joint_bodies[j])
    on_a, on_b = (tuple(anchor) for anchor in model.joint_anchor[j].tolist())
    kind, (low, high) = model.joint_kind[j], model.joint_limit[j].tolist()
    stiffness, damping, rest = model.joint_spring[j].tolist()
    friction, (speed, strength), start = (
        float(model.joint_friction[j]),
        model.joint_motor[j].tolist(),
        float(model.joint_angle[j]),
    )
    if kind == SPRING:
        yield pymunk.DampedSpring(a, b, on_a, on_b, rest, stiffness, damping)
        return
    if kind == PIN:
        yield pymunk.PivotJoint(a, b, on_a, on_b)
        if math.isfinite(low) or math.isfinite(high):
            yield pymunk.RotaryLimitJoint(a, b, start + low, start + high)
        if stiffness or damping:
            yield pymunk.DampedRotarySpring(a, b, -(start + rest), stiffness, damping)
        if strength > 0.0 or friction > 0.0:
            # Chipmunk's rate is that of a against b.
            yield _bounded(pymunk.SimpleMotor(a, b, -speed), max(strength, friction))
    if kind == SLIDER:
        yield from _slider(a, b, on_a, on_b, model.joint_axis[j].tolist(), (low, high))
        yield pymunk.GearJoint(a, b, start, 1.0)
        if stiffness or damping:
            yield pymunk.DampedSpring(a, b, on_a, on_b, rest, stiffness, damping)
        if strength > 0.0 or friction > 0.0:
            yield _drive(a, b, on_a, on_b, model.joint_axis[j].tolist(), speed, max(strength, friction))


def _slider(a, b, on_a, on_b, axis, limits):
    low, high = (max(min(limit, REACH), -REACH) for limit in limits)
    ends = [(on_a[0] + way * axis[0], on_a[1] + way * axis[1]) for way in (low, high)]
    yield pymunk.GrooveJoint(a, b, *ends, on_b)


def _drive(a, b, on_a, on_b, axis, speed, most):
    """Motor of a slider, or with speed 0 its friction: a pivot of bounded force towards a point far ahead on its axis.

    What it takes back of an error is bounded by the speed. The point is fixed in a body that does not turn; if both
    can, it is set anew in each step, one step ahead, since elsewhere it would hold b across the axis too.
    """
    drive = _bounded(pymunk.PivotJoint(a, b, on_a, on_b), most)
    drive.max_bias, drive.error_bias = abs(speed), 0.0
    ahead = math.copysign(REACH, speed) if speed else 0.0
    if a.body_type == pymunk.Body.STATIC:
        drive.anchor_a = on_a[0] + ahead * axis[0], on_a[1] + ahead * axis[1]
    elif b.body_type == pymunk.Body.STATIC:
        x, y = turned(axis, (0.0, 0.0, a.angle - b.angle))
        drive.anchor_b = on_b[0] - ahead * x, on_b[1] - ahead * y
    else:

        def set_ahead(_drive, space):
            way = space.current_time_step * speed
            x, y = a.world_to_local(b.local_to_world(on_b))
            drive.anchor_a = x + way * axis[0], y + way * axis[1]

        drive.pre_solve = set_ahead
    return drive


def _bounded(joint, most):
    joint.max_force = most
    return joint


def stored(model, poses) -> float:
    """Energy in the springs of all joints [J], bodies at `poses` (mass centre, angle)."""
    return sum(
        0.5 * spring[0] * _stretch(model, j, (*poses, (0.0, 0.0, 0.0))) ** 2
        for j, spring in enumerate(model.joint_spring.tolist())
        if spring[0] > 0.0
    )


def _stretch(model, j, poses):
    a, b = (poses[k] for k in model.joint_bodies[j])
    if model.joint_kind[j] == PIN:
        return b[2] - a[2] - model.joint_angle[j] - model.joint_spring[j, 2]
    on_a, on_b = (turned(tuple(anchor), pose) for anchor, pose in zip(model.joint_anchor[j], (a, b), strict=True))
    if model.joint_kind[j] == SPRING:
        return math.dist(on_a, on_b) - model.joint_spring[j, 2]
    ux, uy = turned(tuple(model.joint_axis[j]), (0.0, 0.0, a[2]))
    return ux * (on_b[0] - on_a[0]) + uy * (on_b[1] - on_a[1]) - model.joint_spring[j, 2]
