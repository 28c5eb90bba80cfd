# SPDX-License-Identifier: Apache-2.0
"""A scene as a pymunk Space: bodies at their mass centres, layers, joints, and the settings that SI units ask for.

Chipmunk's collision code has no absolute length in it (a scene scaled by 1024 moves bit for bit the same), only the
settings made here.
"""

import math

import pymunk

from haptic_sim.compile.model import PIN, SLIDER, SPRING
from haptic_sim.joint import WORLD
from haptic_sim.shape import turned

SLOP = 5e-4
"""Overlap that is left alone, in finest features: enough to keep a resting contact alive, too little to be felt."""
PUSH_OUT = 0.15
"""Share of an overlap beyond the slop that one sub-step takes back, at most; more rings at wedged contacts."""
LEAST_BIAS = 1e-300
"""Chipmunk asks for the share left after a second; at short sub-steps that underflows to 0, a push-out of it all."""
SWEEPS_PER_BODY = 20


def make_space(scene, compiled, sub_step):
    """(space, bodies of the model in its order, {body id: name of the scene's body})."""
    space = pymunk.Space()
    space.gravity = scene.gravity
    space.collision_slop = SLOP * scene.feature
    space.collision_bias = max((1.0 - PUSH_OUT) ** (1.0 / sub_step), LEAST_BIAS)
    # A contact that returns within the persistence would keep an impulse it no longer applies, and could pull with it.
    space.collision_persistence = 1
    model = compiled.model
    movable = [_movable(space, model, b) for b in range(len(model.mass) - 1)]
    space.iterations = SWEEPS_PER_BODY * len(movable)
    names = {}
    for solid in (scene.tool, *scene.bodies):
        place = compiled.places[solid.name]
        body = movable[place.body] if place.body < len(movable) else _fixed(space)
        names.setdefault(body.id, solid.name)
        _add_shapes(space, scene, solid, body, place.pose)
    for j in range(len(model.joint_kind)):
        for joint in _joint(model, j, [*movable, space.static_body]):
            joint.collide_bodies, joint.error_bias = _may_collide(scene, model, j, compiled), space.collision_bias
            space.add(joint)
    return space, movable, names


def _movable(space, model, b):
    body = pymunk.Body(float(model.mass[b]), float(model.inertia[b]))
    (x, y, angle), (vx, vy, turn) = model.pose[b].tolist(), model.velocity[b].tolist()
    body.position, body.angle, body.velocity, body.angular_velocity = (x, y), angle, (vx, vy), turn
    space.add(body)
    return body


def _fixed(space):
    body = pymunk.Body(body_type=pymunk.Body.STATIC)
    space.add(body)
    return body


def _add_shapes(space, scene, solid, body, pose):
    material, layers = scene.material(solid), sum(1 << layer % 32 for layer in solid.layers)
    turn = pymunk.Transform.translation(pose[0], pose[1]) @ pymunk.Transform.rotation(pose[2])
    for vertices, radius in solid.outlines:
        placed = [turn @ vertex for vertex in vertices]
        shape = pymunk.Circle(body, radius, placed[0]) if radius > 0.0 else pymunk.Poly(body, placed)
        # Chipmunk multiplies the two coefficients of a pair: the roots make it their geometric mean.
        shape.friction, shape.elasticity = math.sqrt(material.friction), math.sqrt(material.restitution)
        shape.filter = pymunk.ShapeFilter(categories=layers, mask=layers)
        space.add(shape)


def _may_collide(scene, model, j, compiled):
    bodies = {int(b) for b in model.joint_bodies[j]}
    held = [joint for joint in scene.joints if {compiled.places[name].body for name in joint.bodies} == bodies]
    return all(joint.collide or joint.type == "spring" for joint in held) or len(model.mass) - 1 in bodies and any(
        name == WORLD for joint in held for name in joint.bodies)


def _joint(model, j, bodies):
    """Chipmunk's constraints that make one joint of the model."""
    a, b = (bodies[k] for k in model.joint_bodies[j])
    on_a, on_b = (tuple(anchor) for anchor in model.joint_anchor[j].tolist())
    kind, (low, high) = model.joint_kind[j], model.joint_limit[j].tolist()
    stiffness, damping, rest = model.joint_spring[j].tolist()
    friction, (speed, torque), start = float(model.joint_friction[j]), model.joint_motor[j].tolist(), float(
        model.joint_angle[j])
    if kind == SPRING:
        yield pymunk.DampedSpring(a, b, on_a, on_b, rest, stiffness, damping)
        return
    if kind == PIN:
        yield pymunk.PivotJoint(a, b, on_a, on_b)
        if math.isfinite(low) or math.isfinite(high):
            yield pymunk.RotaryLimitJoint(a, b, start + low, start + high)
        if stiffness or damping:
            yield pymunk.DampedRotarySpring(a, b, -(start + rest), stiffness, damping)
        if torque > 0.0 or friction > 0.0:
            # Chipmunk's rate is that of a against b.
            yield _bounded(pymunk.SimpleMotor(a, b, -speed if torque > 0.0 else 0.0), max(torque, friction))
    if kind == SLIDER:
        yield from _slider(a, b, on_a, on_b, model.joint_axis[j].tolist(), (low, high))
        yield pymunk.GearJoint(a, b, start, 1.0)
        if stiffness or damping:
            yield pymunk.DampedSpring(a, b, on_a, on_b, rest, stiffness, damping)
        if friction > 0.0:
            drag = _bounded(pymunk.PivotJoint(a, b, on_a, on_b), friction)
            drag.max_bias = 0.0  # against motion only, not back to where it began
            yield drag


REACH = 100.0
"""m; half the length of a groove without limits."""


def _slider(a, b, on_a, on_b, axis, limits):
    low, high = (max(min(limit, REACH), -REACH) for limit in limits)
    ends = [(on_a[0] + way * axis[0], on_a[1] + way * axis[1]) for way in (low, high)]
    yield pymunk.GrooveJoint(a, b, *ends, on_b)


def _bounded(joint, most):
    joint.max_force = most
    return joint


def stored(model, poses) -> float:
    """Energy in the springs of all joints [J], bodies at `poses` (mass centre, angle)."""
    return sum(0.5 * spring[0] * _stretch(model, j, (*poses, (0.0, 0.0, 0.0))) ** 2
               for j, spring in enumerate(model.joint_spring.tolist()) if spring[0] > 0.0)


def _stretch(model, j, poses):
    a, b = (poses[k] for k in model.joint_bodies[j])
    if model.joint_kind[j] == PIN:
        return b[2] - a[2] - model.joint_angle[j] - model.joint_spring[j, 2]
    on_a, on_b = (turned(tuple(anchor), pose) for anchor, pose in zip(model.joint_anchor[j], (a, b), strict=True))
    if model.joint_kind[j] == SPRING:
        return math.dist(on_a, on_b) - model.joint_spring[j, 2]
    ux, uy = turned(tuple(model.joint_axis[j]), (0.0, 0.0, a[2]))
    return ux * (on_b[0] - on_a[0]) + uy * (on_b[1] - on_a[1]) - model.joint_spring[j, 2]
