# SPDX-License-Identifier: Apache-2.0
"""A scene in Box2D 3 at its best settings; the coupling is a soft weld from a kinematic handle to the tool.

That weld is a spring and damper by backward difference, what section 4 of the paper asks for; its mouse joint does not
turn. pyb2d3 0.11.1 has Box2D 3.1.1, whose sines and angles err by 1e-4: they are made here.
Its numbers have 24 bits.
"""

import math

import numpy as np
import pyb2d3

from bench.methods.world import Impossible, between
from haptic_sim.protocol import Coupling, Planar, StepResult
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.joints import FREE, WORLD
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

# A hundredth of its tolerances (5 mm of slop …): a tenth loses falling_rod, a thousandth lets hammer_nail overlap 1 mm.
pyb2d3.set_length_units_per_meter(0.01)
# Of a step. For equal errors the manual's 4 take twice the time; 32 are faster, but find contacts late in `ratchet`.
SUB_STEPS = 16
# Sub-steps in a unit of time. Joints have 60 Hz, which pyb2d3 cannot set, and at most a quarter of this rate: in such
# units they are as stiff as Box2D allows at every step. In seconds `slider` errs a hundred times as much at 0.25 ms.
RATE = 240.0
REACH = 1.0  # m, half the length of a half-plane; more costs digits


class World:
    """Implements `haptic_sim.lockstep.rollout.LedWorld`."""

    def __init__(self, scene: Scene, sub_step: float):
        self._scene, self._step, self._unit = scene, sub_step, sub_step * RATE / SUB_STEPS
        # Contacts as stiff too; the damping ratio of 10, Box2D's own, leaves twelve times the overlap in hammer_nail.
        gravity, stiff = self._scaled(scene.gravity, 2), {"contact_hertz": RATE / 4.0, "contact_damping_ratio": 1.0}
        self._world = pyb2d3.World(gravity=gravity, **stiff, restitution_threshold=0.0, maximum_linear_speed=1e9)
        self._world.sleeping_enabled = False
        self._ground, self._handle = self._world.create_static_body(), self._world.create_kinematic_body()
        self._solids = {solid.name: solid for solid in (*scene.bodies, scene.tool)}
        self._moving = [name for name, solid in self._solids.items() if name == TOOL or not solid.fixed]
        self._angles = {name: solid.pose[2] for name, solid in self._solids.items()}
        self._bodies = {name: self._add(solid) for name, solid in self._solids.items()}
        self._springs, self._grip, self._books = [], None, False
        for joint in scene.joints:
            self._join(joint)

    def couple(self, gains: Coupling) -> None:
        """Takes these gains."""
        mass, inertia, _ = self._scene.tool.mass_properties
        if self._grip:
            self._grip.destroy()
        self._grip = None
        if gains.stiffness > 0.0:
            self._grip = grip = self._world.create_weld_joint(self._handle, self._bodies[TOOL])
            grip.linear_hertz, grip.linear_damping_ratio = self._soft(*gains[:2], mass)
            grip.angular_hertz, grip.angular_damping_ratio = self._soft(*gains[2:], inertia)

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """`n` steps from each row of the hand's path to the next."""
        h, unit, world, grip, handle = self._step, self._unit, self._world, self._grip, self._handle
        supplied, place, force = 0.0, self.pose(TOOL), self._force() if grip else None
        for x, y, angle, vx, vy, rate in between(target, n)[1:].tolist():
            if grip:  # the handle comes to this row as the step ends
                handle.set_transform((x - h * vx, y - h * vy), _rotation(angle - h * rate))
                handle.linear_velocity, handle.angular_velocity = (unit * vx, unit * vy), unit * rate
            world.step(SUB_STEPS / RATE, SUB_STEPS)
            if grip and self._books:
                before, was, place, force = place, force, self.pose(TOOL), self._force()
                supplied += 0.5 * sum((f + g) * (q - p) for f, g, p, q in zip(was, force, before, place, strict=True))
        return StepResult(supplied)

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame."""
        item, last = self._bodies[body], self._angles[body]
        angle = math.atan2(item.rotation.s, item.rotation.c)
        self._angles[body] = angle + math.tau * round((last - angle) / math.tau)
        return item.position.x, item.position.y, self._angles[body]

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J]; springs of pins included."""
        self._books, square = True, self._unit**2
        kinetic, potential = 0.0, sum(0.5 * k * (self.pose(name)[2] - rest) ** 2 for name, rest, k in self._springs)
        for name in self._moving:
            item, (mass, inertia, _) = self._bodies[name], self._solids[name].mass_properties
            (vx, vy), at, (gx, gy) = item.linear_velocity, item.world_center_of_mass(), self._scene.gravity
            kinetic += 0.5 * (mass * (vx * vx + vy * vy) + inertia * item.angular_velocity**2) / square
            potential -= mass * (gx * at.x + gy * at.y)
        return kinetic, potential

    def _force(self):
        """Force and torque of the coupling in the last sub-step."""
        force = self._grip.get_constraint_force()
        return self._scaled((force.x, force.y, self._grip.get_constraint_torque()), -2)

    def _scaled(self, values, power=1):
        return tuple(value * self._unit**power for value in values)

    def _soft(self, stiffness, damping, mass):
        """Frequency and damping ratio of a spring and damper on a mass, or on an inertia."""
        rate = math.sqrt(stiffness / mass)
        return self._unit * rate / math.tau, damping / (2.0 * mass * rate) if rate else 0.0

    def _add(self, solid):
        fixed = solid.name not in self._moving
        if fixed and any(solid.surface_velocity):
            raise Impossible("no belt is written for Box2D here")
        kind, angle = pyb2d3.BodyType.STATIC if fixed else pyb2d3.BodyType.DYNAMIC, solid.pose[2]
        at = {"position": solid.pose[:2], "rotation": _rotation(angle)}
        body = self._world.create_body(type=kind, is_bullet=not fixed, **at)
        bits, material = sum(1 << layer for layer in solid.layers), self._scene.material(solid)
        described = pyb2d3.shape_def(
            material=pyb2d3.surface_material(friction=material.friction, restitution=material.restitution),
            filter=pyb2d3.make_filter(category_bits=bits, mask_bits=bits),
        )
        body.create_shapes(described, map(_shape, solid.shapes))
        if not fixed:
            given, (vx, vy, rate) = pyb2d3.MassData(), solid.velocity
            given.mass, given.rotational_inertia, given.center = solid.mass_properties
            body.mass_data = given
            x, y = turned(solid.mass_properties.center, (0.0, 0.0, angle))
            body.linear_velocity = self._scaled((vx - rate * y, vy + rate * x))
            body.angular_velocity = self._unit * rate
        return body

    def _join(self, joint):
        pin = joint.type == "pin"
        sprung = pin and joint.bodies[0] == WORLD and joint.stiffness > 0.0
        if joint.type not in ("pin", "slider") or ((joint.stiffness or joint.damping) and not sprung):
            raise Impossible(f"no {joint.type} with these properties is written for Box2D here")
        a, b = ((self._bodies | {WORLD: self._ground})[name] for name in joint.bodies)
        place = joint.places(*(self._solids.get(name) for name in joint.bodies))[0]
        from_a, to_b = (self._angles.get(name, 0.0) for name in joint.bodies)
        speed, most = joint.drive if joint.drive[1] else (0.0, joint.friction)
        low, high = (0.0, 0.0) if joint.range == FREE else joint.range
        common = {"enable_limit": joint.range != FREE, "enable_motor": most > 0.0, "motor_speed": self._unit * speed}
        common |= {"max_motor_torque" if pin else "max_motor_force": self._unit**2 * most}
        if sprung:  # Box2D's spring rests where both bodies have one angle, whatever `reference_angle`
            name, from_a = joint.bodies[1], to_b + joint.rest
            a = self._world.create_static_body(rotation=_rotation(from_a))
            hertz, ratio = self._soft(joint.stiffness, joint.damping, self._solids[name].mass_properties.inertia)
            common |= {"enable_spring": True, "hertz": hertz, "damping_ratio": ratio}
            self._springs.append((name, from_a, joint.stiffness))
        common |= {"local_anchor_a": a.local_point(place), "local_anchor_b": b.local_point(place)}
        common |= {"reference_angle": to_b - from_a, "collide_connected": joint.collide}
        if pin:
            self._world.create_revolute_joint(a, b, **common, lower_angle=low, upper_angle=high)
        else:
            common |= {"lower_translation": low, "upper_translation": high}
            self._world.create_prismatic_joint(a, b, **common, local_axis_a=a.local_vector(joint.axis))


def _rotation(angle):
    turn = pyb2d3.Rot(0.0)
    turn.c, turn.s = math.cos(angle), math.sin(angle)
    return turn


def _shape(shape):
    vertices, radius = shape.outline
    if radius > 0.0:
        return pyb2d3.circle(vertices[0], radius)
    if not shape.bounded:
        (px, py), (nx, ny) = shape.point, shape.normal
        length = math.hypot(nx, ny) / REACH
        x, y = nx / length, ny / length
        vertices = [(px - s * y - d * x, py + s * x - d * y) for s, d in ((1, 0), (1, 0.2), (-1, 0.2), (-1, 0))]
    return pyb2d3.polygon(vertices)
