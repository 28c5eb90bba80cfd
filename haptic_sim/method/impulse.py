# SPDX-License-Identifier: Apache-2.0
"""Impulse method: contacts by Chipmunk's sequential impulses (pymunk), the coupling solved together with them.

The coupling, by backward difference. Over a sub-step h the tool (mass m, velocity v, position x at its start) obeys

    m (v⁺ − v) = h m g + h [K (x_h⁺ − x⁺) + B (v_h⁺ − v⁺)] + J,        x⁺ = x + h v⁺                    (1)

with the handle x_h⁺, v_h⁺ at the END of the sub-step and J the contact impulse. Insert x⁺ and collect v⁺:

    m_e v⁺ = m (v + h g) + h [K (x_h⁺ − x) + B v_h⁺] + J,               m_e = m + h B + h² K              (2)

So a body of mass m_e that enters the contact solver with v_free = {m (v + h g) + h [K (x_h⁺ − x) + B v_h⁺]} / m_e
leaves it with v⁺ of (1): impulses act through 1/m_e, which is what the coupling lets the tool move. No term of (1) is
explicit, so no K, B, h makes it unstable, and gravity keeps the true mass. Rotation likewise with I, K_θ, B_θ; the
grip is the mass centre, so the two do not mix. Limits: K = B = 0 is the free body; h → 0 is m v̇ = m g + K (x_h − x) +
B (v_h − v) + f_contact; h²K ≫ m gives x⁺ = x_h⁺. The force on the tool is K (x_h⁺ − x⁺) + B (v_h⁺ − v⁺), and with (1)
it balances inertia and contacts to rounding.

Chipmunk's own order. `Space.step` first moves bodies with the velocity of the step before (and its push-out velocity),
then finds contacts there, then updates velocities, then solves. Our sub-step therefore ends between two Chipmunk
steps: x⁺ = x + h v⁺ is what the next step will move to, apart from push-out of overlaps, which enters as x of the next
sub-step.

Units are SI as they stand: Chipmunk's collision code has no absolute length in it (a scene scaled by 1024 moves bit
for bit the same), only the three settings made here.
"""

import math

import pymunk
from pymunk import batch

from haptic_sim.method import Contact, Coupling, Planar
from haptic_sim.scene import Scene
from haptic_sim.solid import TOOL

SLOP = 5e-4
"""Overlap that is left alone, in finest features: enough to keep a resting contact alive, too little to be felt."""
PUSH_OUT = 0.15
"""Share of an overlap beyond the slop that one sub-step takes back, at most; more rings at wedged contacts."""
LEAST_BIAS = 1e-300
"""Chipmunk asks for the share left after a second; at short sub-steps that underflows to 0, a push-out of it all."""
SWEEPS_PER_BODY = 20

_PAIR = batch.ArbiterFields
_TOUCH = _PAIR.POINT_A_1 | _PAIR.POINT_B_1 | _PAIR.DISTANCE_1 | _PAIR.POINT_A_2 | _PAIR.POINT_B_2 | _PAIR.DISTANCE_2
_FIELDS = _PAIR.BODY_A_ID | _PAIR.BODY_B_ID | _PAIR.CONTACT_COUNT | _PAIR.TOTAL_IMPULSE | _PAIR.NORMAL | _TOUCH


class Impulse:
    """The scene as a pymunk Space, stepped by `sub_step` [s]. It belongs to one thread. Implements `Method`."""

    def __init__(self, scene: Scene, sub_step: float):
        self.scene = scene
        self.sub_step = sub_step
        self._gravity = scene.gravity
        self._mass, self._inertia, _ = scene.tool.mass_properties
        self._gains = Coupling()
        self._pairs = batch.Buffer()
        self.reset()

    def reset(self) -> None:
        """Everything back to the scene's start, with the same gains."""
        self._space = _space(self.scene, self.sub_step)
        solids = (*self.scene.bodies, self.scene.tool)
        self._bodies = {solid.name: _add(self._space, self.scene, solid) for solid in solids}
        self._order = {body.id: (name != TOOL, rank, name) for rank, (name, body) in enumerate(self._bodies.items())}
        self._tool = self._bodies[TOOL]
        self._others = [self._bodies[body.name] for body in self.scene.bodies if not body.fixed]
        self._tool.velocity_func = self._couple_tool
        self.position: Planar = self.scene.tool.pose
        self.velocity: Planar = (0.0, 0.0, 0.0)
        self.force_on_tool: Planar = (0.0, 0.0, 0.0)
        self.touching = False
        self._set_effective_mass()

    def couple(self, coupling: Coupling) -> None:
        """Take these gains from the next sub-step on; ValueError if one is negative or not finite."""
        if coupling == self._gains:
            return
        for name, gain in zip(Coupling._fields, coupling, strict=True):
            if not 0.0 <= gain < math.inf:
                raise ValueError(f"coupling {name} is {gain}; it must be finite and at least 0")
        self._gains = coupling
        self._set_effective_mass()

    def step(self, handle_position: Planar, handle_velocity: Planar) -> None:
        """Advance one sub-step; the arguments are the handle's at its end."""
        self._handle = handle_position, handle_velocity
        self._space.step(self.sub_step)
        self._read_tool()

    def contacts(self) -> list[Contact]:
        """Contacts of the last sub-step, sorted by bodies and place."""
        self._pairs.clear()
        batch.get_space_arbiters(self._space, _FIELDS, self._pairs)
        whole = memoryview(self._pairs.int_buf()).cast("P").tolist()
        real = memoryview(self._pairs.float_buf()).cast("d").tolist()
        return sorted(self._contact(whole[3 * i:3 * i + 3], real[14 * i:14 * i + 14])
                      for i in range(len(whole) // 3) if whole[3 * i + 2])

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame at the end of the sub-step."""
        if body == TOOL:
            return self.position
        item, h = self._bodies[body], self.sub_step
        turn = h * item.angular_velocity
        center = item.center_of_gravity
        moved = item.position + center.rotated(item.angle) + h * item.velocity - center.rotated(item.angle + turn)
        return moved.x, moved.y, item.angle + turn

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of all bodies [J], with the tool's true mass; potential is 0 at the origin."""
        (x, y, _), (vx, vy, w), (gx, gy) = self.position, self.velocity, self._gravity
        kinetic = 0.5 * (self._mass * (vx * vx + vy * vy) + self._inertia * w * w)
        potential = -self._mass * (gx * x + gy * y)
        for body in self._others:
            center = body.local_to_world(body.center_of_gravity) + self.sub_step * body.velocity
            # Chipmunk's own kinetic_energy lacks the half.
            kinetic += 0.5 * (body.mass * body.velocity.length_squared + body.moment * body.angular_velocity**2)
            potential -= body.mass * (gx * center.x + gy * center.y)
        return kinetic, potential

    def _set_effective_mass(self):
        stiffness, damping, rotational_stiffness, rotational_damping = self._gains
        h = self.sub_step
        self._tool.mass = self._mass + h * damping + h * h * stiffness
        self._tool.moment = self._inertia + h * rotational_damping + h * h * rotational_stiffness
        self._effective = self._tool.mass, self._tool.moment

    def _couple_tool(self, tool, _gravity, _damping, h):
        """Velocity update of the tool, called by Chipmunk between finding contacts and solving them: v_free of (2)."""
        stiffness, damping, rotational_stiffness, rotational_damping = self._gains
        (hx, hy, ht), (hvx, hvy, hw) = self._handle
        mass, inertia, (gx, gy) = self._mass, self._inertia, self._gravity
        effective_mass, effective_inertia = self._effective
        x, y = tool.position
        vx, vy = tool.velocity
        angle = tool.angle
        free_x = (mass * (vx + h * gx) + h * (stiffness * (hx - x) + damping * hvx)) / effective_mass
        free_y = (mass * (vy + h * gy) + h * (stiffness * (hy - y) + damping * hvy)) / effective_mass
        torque = rotational_stiffness * (ht - angle) + rotational_damping * hw
        free_w = (inertia * tool.angular_velocity + h * torque) / effective_inertia
        tool.velocity = free_x, free_y
        tool.angular_velocity = free_w
        self._start = x, y, angle
        self._free = free_x, free_y, free_w

    def _read_tool(self):
        stiffness, damping, rotational_stiffness, rotational_damping = self._gains
        (hx, hy, ht), (hvx, hvy, hw) = self._handle
        (x, y, angle), h = self._start, self.sub_step
        vx, vy = self._tool.velocity
        w = self._tool.angular_velocity
        self.velocity = vx, vy, w
        self.position = x, y, angle = x + h * vx, y + h * vy, angle + h * w
        self.force_on_tool = (stiffness * (hx - x) + damping * (hvx - vx), stiffness * (hy - y) + damping * (hvy - vy),
                              rotational_stiffness * (ht - angle) + rotational_damping * (hw - w))
        self.touching = self.velocity != self._free

    def _contact(self, whole, real):
        body_a, body_b, count = whole
        points = [real[4:8], real[9:13]][:count]
        x = sum(ax + bx for ax, _, bx, _ in points) / (2 * count)
        y = sum(ay + by for _, ay, _, by in points) / (2 * count)
        depth = -min((real[8], real[13])[:count])
        a, b = self._order[body_a], self._order[body_b]
        sign = 1.0 if a < b else -1.0
        normal = sign * real[2], sign * real[3]
        force_on_a = sign * real[0] / self.sub_step, sign * real[1] / self.sub_step
        return Contact(min(a, b)[2], max(a, b)[2], (x, y), normal, force_on_a, depth)


def _space(scene, sub_step):
    space = pymunk.Space()
    space.gravity = scene.gravity
    space.collision_slop = SLOP * scene.feature
    space.collision_bias = max((1.0 - PUSH_OUT) ** (1.0 / sub_step), LEAST_BIAS)
    # A contact that returns within the persistence would keep an impulse it no longer applies, and could pull with it.
    space.collision_persistence = 1
    space.iterations = SWEEPS_PER_BODY * (1 + sum(not body.fixed for body in scene.bodies))
    return space


def _add(space, scene, solid):
    fixed = solid.name != TOOL and solid.fixed
    if fixed:
        body = pymunk.Body(body_type=pymunk.Body.STATIC)
    else:
        mass, inertia, center = solid.mass_properties
        body = pymunk.Body(mass, inertia)
        body.center_of_gravity = center
    body.angle = solid.pose[2]  # before the position, which moves the mass centre by the angle that it finds
    body.position = solid.pose[:2]
    space.add(body)
    material = scene.material(solid)
    for vertices, radius in solid.outlines:
        shape = pymunk.Circle(body, radius, vertices[0]) if radius > 0.0 else pymunk.Poly(body, vertices)
        # Chipmunk multiplies the two coefficients of a pair: the roots make it their geometric mean.
        shape.friction, shape.elasticity = math.sqrt(material.friction), math.sqrt(material.restitution)
        space.add(shape)
    return body
