# SPDX-License-Identifier: Apache-2.0
"""A scene in Box2D (pybox2d 2.3): its best settings for millimetres, its soft mouse joint as the coupling.

Box2D's tolerances are lengths (0.005 units of slop, skin of 0.01 a polygon, at most 2 units a step) and its numbers
have 24 bits: a unit is a millimetre, or more where a body would pass 1 unit a step. Its mouse joint is a spring and
damper by backward difference, what section 4 of the paper asks for; the turning part is a torque before each step.
"""

import math

import Box2D
import numpy as np

from bench.methods.world import Impossible, between
from haptic_sim.protocol import Coupling, Planar, StepResult
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.joints import FREE, WORLD
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

UNIT = 1e-3
SWEEPS = 30, 10
"""Iterations for velocities and for positions; the manual's 8, 3 leave ten times the error here."""
REACH = 1.0  # m, half the length of a half-plane; more costs digits
ENDLESS = 1e12


class World:
    """Implements `bench.methods.world.World`."""

    def __init__(self, scene: Scene, sub_step: float):
        fastest = max(math.hypot(*solid.velocity[:2]) for solid in (*scene.bodies, scene.tool))
        self._unit = max(UNIT, fastest * sub_step)
        self._scene, self._step = scene, sub_step
        self._world = Box2D.b2World(gravity=self._scaled(scene.gravity), doSleep=False)
        self._ground = self._world.CreateStaticBody()
        self._bodies = {solid.name: self._add(solid) for solid in (*scene.bodies, scene.tool)}
        self._tool, self._springs, self._grip = self._bodies[TOOL], [], None
        for joint in scene.joints:
            self._join(joint)

    def couple(self, gains: Coupling) -> None:
        """Takes these gains."""
        self._gains = gains
        if self._grip:
            self._world.DestroyJoint(self._grip)
        self._grip = None
        if gains.stiffness > 0.0:
            mass = self._tool.mass
            rate = math.sqrt(gains.stiffness / mass)
            self._grip = self._world.CreateMouseJoint(
                bodyA=self._ground,
                bodyB=self._tool,
                target=self._tool.position,
                maxForce=ENDLESS,
                frequencyHz=rate / (2.0 * math.pi),
                dampingRatio=gains.damping / (2.0 * mass * rate),
            )

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """`n` steps from each row of the hand's path to the next."""
        unit, h, tool, world, grip = self._unit, self._step, self._tool, self._world, self._grip
        stiffness, damping, turning, turning_damping = self._gains
        lead, supplied = damping / stiffness if stiffness > 0.0 else 0.0, 0.0
        for x, y, angle, vx, vy, rate in between(target, n)[1:].tolist():
            at = tool.angle
            px, py = tool.position
            torque = turning * (angle - at) + turning_damping * (rate - tool.angularVelocity)
            if turning > 0.0:
                tool.ApplyTorque(torque / unit**2, True)
            if grip:
                grip.target = (x + lead * vx) / unit, (y + lead * vy) / unit
            for spring in self._springs:
                spring()
            world.Step(h, *SWEEPS)
            if grip:
                qx, qy = tool.position
                force = grip.GetReactionForce(1.0 / h)
                supplied += unit * unit * (force[0] * (qx - px) + force[1] * (qy - py))
            supplied += torque * (tool.angle - at)
        return StepResult(supplied)

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame."""
        item = self._bodies[body]
        x, y = item.position
        return self._unit * x, self._unit * y, item.angle

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J]; springs of pins included."""
        kinetic, potential, square = 0.0, 0.0, self._unit**2
        for solid in (*self._scene.bodies, self._scene.tool):
            item = self._bodies[solid.name]
            if item.type == Box2D.b2_dynamicBody:
                mass, inertia, _ = solid.mass_properties
                vx, vy = item.GetLinearVelocityFromWorldPoint(item.worldCenter)
                kinetic += 0.5 * mass * square * (vx * vx + vy * vy) + 0.5 * inertia * item.angularVelocity**2
                potential -= (
                    mass * self._unit * sum(g * x for g, x in zip(self._scene.gravity, item.worldCenter, strict=True))
                )
        return kinetic, potential + sum(spring.energy() for spring in self._springs)

    def _scaled(self, point):
        return point[0] / self._unit, point[1] / self._unit

    def _add(self, solid):
        fixed = solid.name != TOOL and solid.fixed
        if fixed and any(solid.surface_velocity):
            raise Impossible("no belt is written for Box2D here")
        kind = Box2D.b2_staticBody if fixed else Box2D.b2_dynamicBody
        body = self._world.CreateBody(
            type=kind, position=self._scaled(solid.pose[:2]), angle=solid.pose[2], bullet=not fixed
        )
        bits, material = sum(1 << layer for layer in solid.layers), self._scene.material(solid)
        for shape in solid.shapes:
            body.CreateFixture(
                shape=self._shape(shape),
                density=0.0,
                friction=material.friction,
                restitution=material.restitution,
                categoryBits=bits,
                maskBits=bits,
            )
        if not fixed:
            mass, inertia, center = solid.mass_properties
            about_frame = inertia + mass * (center[0] ** 2 + center[1] ** 2)
            body.massData = Box2D.b2MassData(mass=mass, center=self._scaled(center), I=about_frame / self._unit**2)
            x, y = turned(center, (0.0, 0.0, solid.pose[2]))
            vx, vy, rate = solid.velocity
            body.linearVelocity, body.angularVelocity = self._scaled((vx - rate * y, vy + rate * x)), rate
        return body

    def _shape(self, shape):
        vertices, radius = shape.outline
        if radius > 0.0:
            return Box2D.b2CircleShape(pos=self._scaled(vertices[0]), radius=radius / self._unit)
        if not shape.bounded:
            (px, py), (nx, ny) = shape.point, shape.normal
            length = math.hypot(nx, ny) / REACH
            tx, ty = -ny / length, nx / length
            vertices = [
                (px + s * tx - d * nx / length, py + s * ty - d * ny / length)
                for s, d in ((1, 0), (1, 0.2), (-1, 0.2), (-1, 0))
            ]
        return Box2D.b2PolygonShape(vertices=[self._scaled(vertex) for vertex in vertices])

    def _join(self, joint):
        bodies = {**self._bodies, WORLD: self._ground}
        a, b = (bodies[name] for name in joint.bodies)
        solids = {body.name: body for body in self._scene.bodies} | {TOOL: self._scene.tool}
        place = self._scaled(joint.places(*(solids.get(name) for name in joint.bodies))[0])
        common = {"bodyA": a, "bodyB": b, "anchor": place, "collideConnected": joint.collide}
        limited = joint.range != FREE
        low, high = joint.range if limited else (0.0, 0.0)
        speed, most = joint.drive if joint.drive[1] else (0.0, joint.friction)
        if joint.type == "pin":
            self._world.CreateRevoluteJoint(
                **common,
                enableLimit=limited,
                lowerAngle=low,
                upperAngle=high,
                enableMotor=most > 0.0,
                motorSpeed=speed,
                maxMotorTorque=most / self._unit**2,
            )
            if joint.stiffness or joint.damping:
                self._springs.append(_Spring(a, b, joint, self._unit))
        elif joint.type == "slider" and not (joint.stiffness or joint.damping):
            self._world.CreatePrismaticJoint(
                **common,
                axis=joint.axis,
                enableLimit=limited,
                lowerTranslation=low / self._unit,
                upperTranslation=high / self._unit,
                enableMotor=most > 0.0,
                motorSpeed=speed / self._unit,
                maxMotorForce=most / self._unit,
            )
        else:
            raise Impossible(f"no {joint.type} with these properties is written for Box2D here")


class _Spring:
    """Spring and damper about a pin, a torque before each step: Box2D has none."""

    def __init__(self, a, b, joint, unit):
        self._a, self._b, self._unit = a, b, unit
        self._stiffness, self._damping, self._rest = joint.stiffness, joint.damping, joint.rest
        self._start = b.angle - a.angle

    def __call__(self):
        rate = self._b.angularVelocity - self._a.angularVelocity
        torque = -self._stiffness * self._stretch() - self._damping * rate
        self._b.ApplyTorque(torque / self._unit**2, True)
        self._a.ApplyTorque(-torque / self._unit**2, True)

    def energy(self):
        return 0.5 * self._stiffness * self._stretch() ** 2

    def _stretch(self):
        return self._b.angle - self._a.angle - self._start - self._rest
