# SPDX-License-Identifier: Apache-2.0
"""A scene in pymunk (Chipmunk) as it comes: its own joints, 10 iterations, the coupling as a force before each step.

Only what SI asks for is set: the overlap that is left alone, 0.1 of whatever unit, is taken for 10 um.
"""

import math

import numpy as np
import pymunk

from bench.methods.world import Impossible, between
from haptic_sim.protocol import Coupling, Planar, StepResult
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.joints import WORLD
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

SLOP = 1e-5
FAR = 10.0  # m, length of a groove without stops


class World:
    """Implements `bench.methods.world.World`."""

    def __init__(self, scene: Scene, sub_step: float):
        self._step = sub_step
        self._space = space = pymunk.Space()
        space.gravity, space.collision_slop = scene.gravity, SLOP
        self._bodies = {solid.name: _add(space, scene, solid) for solid in (*scene.bodies, scene.tool)}
        self._tool = self._bodies[TOOL]
        for joint in scene.joints:
            _join(space, scene, joint, {**self._bodies, WORLD: space.static_body})

    def couple(self, gains: Coupling) -> None:
        """Takes these gains."""
        self._gains = gains

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """`n` steps from each row of the hand's path to the next."""
        tool, space, h = self._tool, self._space, self._step
        stiffness, damping, turning, turning_damping = self._gains
        supplied = 0.0
        for x, y, angle, vx, vy, rate in between(target, n)[1:].tolist():
            (px, py), (ux, uy), turn = tool.position, tool.velocity, tool.angular_velocity
            # Chipmunk moves first and accelerates then: the force is that of the place it moves to.
            force = (
                stiffness * (x - px - h * ux) + damping * (vx - ux),
                stiffness * (y - py - h * uy) + damping * (vy - uy),
            )
            torque = turning * (angle - tool.angle - h * turn) + turning_damping * (rate - turn)
            tool.force, tool.torque = force, torque
            space.step(h)
            ux, uy = tool.velocity
            supplied += h * (force[0] * ux + force[1] * uy + torque * tool.angular_velocity)
        return StepResult(supplied)

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame."""
        item = self._bodies[body]
        return *item.position, item.angle

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J]."""
        kinetic = potential = 0.0
        for body in self._space.bodies:
            if body.body_type == pymunk.Body.DYNAMIC:
                center = body.local_to_world(body.center_of_gravity)
                kinetic += 0.5 * (body.mass * body.velocity.length_squared + body.moment * body.angular_velocity**2)
                potential -= body.mass * center.dot(self._space.gravity)
        for spring in self._space.constraints:
            if isinstance(spring, pymunk.DampedRotarySpring):
                angle = spring.a.angle - spring.b.angle - spring.rest_angle
                potential += 0.5 * spring.stiffness * angle * angle
        return kinetic, potential


def _add(space, scene, solid):
    if solid.name != TOOL and solid.fixed:
        body = pymunk.Body(body_type=pymunk.Body.STATIC)
    else:
        mass, inertia, center = solid.mass_properties
        body = pymunk.Body(mass, inertia)
        body.center_of_gravity = center
    body.angle = solid.pose[2]  # before the place, which pymunk keeps as that of the mass centre
    body.position = solid.pose[:2]
    if body.body_type == pymunk.Body.DYNAMIC:
        body.angular_velocity = solid.velocity[2]
        x, y = turned(body.center_of_gravity, (0.0, 0.0, solid.pose[2]))
        body.velocity = solid.velocity[0] - solid.velocity[2] * y, solid.velocity[1] + solid.velocity[2] * x
    space.add(body)
    material, bits = scene.material(solid), sum(1 << layer for layer in solid.layers)
    for vertices, radius in solid.outlines:
        shape = pymunk.Circle(body, radius, vertices[0]) if radius > 0.0 else pymunk.Poly(body, vertices)
        shape.friction, shape.elasticity = math.sqrt(material.friction), math.sqrt(material.restitution)
        shape.filter = pymunk.ShapeFilter(categories=bits, mask=bits)
        if solid.name != TOOL:
            shape.surface_velocity = turned(solid.surface_velocity, (0.0, 0.0, solid.pose[2]))
        space.add(shape)
    return body


def _join(space, scene, joint, bodies):
    a, b = (bodies[name] for name in joint.bodies)
    place = joint.places(*(scene.solids.get(name) for name in joint.bodies))[0]
    if joint.type == "pin":
        parts = [pymunk.PivotJoint(a, b, a.world_to_local(place), b.world_to_local(place)), *_about_pin(joint, a, b)]
    elif joint.type == "slider":
        parts = _along_slider(joint, a, b, place)
    else:
        raise Impossible(f"no {joint.type} is written for pymunk here")
    for part in parts:
        part.collide_bodies = joint.collide
    space.add(*parts)


def _about_pin(joint, a, b):
    start = b.angle - a.angle
    if joint.limits:
        yield pymunk.RotaryLimitJoint(a, b, start + joint.limits[0], start + joint.limits[1])
    if joint.friction or joint.motor:
        speed, torque = joint.drive
        motor = pymunk.SimpleMotor(a, b, -speed)
        motor.max_force = torque or joint.friction
        yield motor
    if joint.stiffness or joint.damping:
        yield pymunk.DampedRotarySpring(a, b, -(start + joint.rest), joint.stiffness, joint.damping)


def _along_slider(joint, a, b, place):
    if joint.stiffness or joint.damping:
        raise Impossible("no spring along a groove")
    if joint.motor:
        raise Impossible("no motor along a groove")
    low, high = joint.limits or (-FAR, FAR)
    length = math.hypot(*joint.axis)
    ends = [
        a.world_to_local((place[0] + way * joint.axis[0] / length, place[1] + way * joint.axis[1] / length))
        for way in (low, high)
    ]
    parts = [pymunk.GrooveJoint(a, b, *ends, b.world_to_local(place)), pymunk.GearJoint(a, b, b.angle - a.angle, 1.0)]
    if joint.friction:  # a pivot that only brakes and never pulls back
        parts.append(pymunk.PivotJoint(a, b, a.world_to_local(place), b.world_to_local(place)))
        parts[-1].max_force, parts[-1].max_bias = joint.friction, 0.0
    return parts
