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

Time of impact. Chipmunk sees a contact only where shapes overlap, so a fast body could pass a thin one between two
looks. The way that the next move would take is looked at before it is made (`guard`); if it leads into something, all
move only up to there, the contact is solved, and the time left out is moved after it, at the velocities it left.

Restitution. An impact at speed v₀ under a push f gives back energy at the port that it did not have unless
v₀ ≥ 2 |f| h e/(m (1 − e²)), the push taken over a sub-step h; a slower one gets e = 0.

Neither Chipmunk's sweeps nor its push-out are exact, so this method is passive at the port only up to what the push-out
of overlaps puts in: contact force times `Contact.depth`. What that and the contacts are cannot be told from the rest.
"""

import math

from pymunk import batch

from haptic_sim.compile import compile_scene
from haptic_sim.method import Contact, Coupling, Planar
from haptic_sim.method.chipmunk import make_space, stored
from haptic_sim.method.guard import Guard
from haptic_sim.scene import Scene
from haptic_sim.shape import turned
from haptic_sim.solid import TOOL

_PAIR = batch.ArbiterFields
_TOUCH = _PAIR.POINT_A_1 | _PAIR.POINT_B_1 | _PAIR.DISTANCE_1 | _PAIR.POINT_A_2 | _PAIR.POINT_B_2 | _PAIR.DISTANCE_2
_FIELDS = _PAIR.BODY_A_ID | _PAIR.BODY_B_ID | _PAIR.CONTACT_COUNT | _PAIR.TOTAL_IMPULSE | _PAIR.NORMAL | _TOUCH


class Impulse:
    """The scene as a pymunk Space, stepped by `sub_step` [s]. It belongs to one thread. Implements `Method`."""

    passive = False

    def __init__(self, scene: Scene, sub_step: float):
        self.scene, self.sub_step = scene, sub_step
        self._compiled = compile_scene(scene)
        self._gravity = scene.gravity
        self._mass, self._inertia, _ = scene.tool.mass_properties
        self._gains = Coupling()
        self._pairs = batch.Buffer()
        self._guard = Guard(scene, self._compiled)
        self.reset()

    def reset(self) -> None:
        """Everything back to the scene's start, with the same gains."""
        self._space, self._bodies, names = make_space(self.scene, self._compiled, self.sub_step)
        order = {name: rank for rank, name in enumerate(body.name for body in self.scene.bodies)}
        self._order = {body: (name != TOOL, order.get(name, 0), name) for body, name in names.items()}
        self._tool = self._bodies[0]
        self._tool.velocity_func = self._couple_tool
        self._jointed = bool(self._tool.constraints)
        self._elastic = any(shape.elasticity for shape in self._space.shapes)
        if self._elastic:
            self._space.on_collision(pre_solve=self._limit_rebound)
        self._move = 0.0  # s; how far along their velocities the bodies are from where Chipmunk has them
        self._debt = 0.0  # s; moves still owed
        self.position: Planar = self.scene.tool.pose
        self.velocity: Planar = self.scene.tool.velocity
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
        self._solve()
        wish = self.sub_step + self._debt
        self._move = wish * self._guard.share(self._bodies, wish)
        self._debt = min(wish - self._move, self.sub_step)
        self._read_tool()

    def contacts(self) -> list[Contact]:
        """Contacts of the last sub-step, sorted by bodies and place."""
        self._pairs.clear()
        batch.get_space_arbiters(self._space, _FIELDS, self._pairs)
        whole = memoryview(self._pairs.int_buf()).cast("P").tolist()
        real = memoryview(self._pairs.float_buf()).cast("d").tolist()
        return sorted(self._contact(whole[3 * i:3 * i + 3], real[14 * i:14 * i + 14])
                      for i in range(len(whole) // 3) if whole[3 * i + 2])

    def bodies(self) -> list[tuple[Planar, Planar]]:
        """Pose and velocity of every moving body's mass centre, as in the compiled model."""
        centres = map(self._center, self._bodies)
        return [((*center, angle), (*body.velocity, body.angular_velocity))
                for (center, angle), body in zip(centres, self._bodies, strict=True)]

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame at the end of the sub-step."""
        index, pose = self._compiled.places[body]
        if index == len(self._bodies):
            return pose
        (x, y), angle = self._center(self._bodies[index])
        return *turned(pose[:2], (x, y, angle)), angle + pose[2]

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of all bodies [J], with the tool's true mass; potential is 0 at the origin."""
        (x, y, _), (vx, vy, w), (gx, gy) = self.position, self.velocity, self._gravity
        kinetic = 0.5 * (self._mass * (vx * vx + vy * vy) + self._inertia * w * w)
        potential = -self._mass * (gx * x + gy * y)
        for body in self._bodies[1:]:
            (x, y), _ = self._center(body)
            # Chipmunk's own kinetic_energy lacks the half.
            kinetic += 0.5 * (body.mass * body.velocity.length_squared + body.moment * body.angular_velocity**2)
            potential -= body.mass * (gx * x + gy * y)
        if len(self._compiled.model.joint_kind):
            places = map(self._center, self._bodies)
            potential += stored(self._compiled.model, [(*center, angle) for center, angle in places])
        return kinetic, potential

    def _center(self, body):
        """Mass centre and angle at the end of the sub-step."""
        return body.position + self._move * body.velocity, body.angle + self._move * body.angular_velocity

    def _solve(self):
        """Chipmunk's step: to where the bodies are, contacts there, velocities over a sub-step."""
        ahead = self._move - self.sub_step
        if ahead:
            for body in self._bodies:
                body.position += ahead * body.velocity
                body.angle += ahead * body.angular_velocity
        self._space.step(self.sub_step)

    def _set_effective_mass(self):
        stiffness, damping, rotational_stiffness, rotational_damping = self._gains
        h = self.sub_step
        self._tool.mass = self._mass + h * damping + h * h * stiffness
        self._tool.moment = self._inertia + h * rotational_damping + h * h * rotational_stiffness
        self._effective = self._tool.mass, self._tool.moment

    def _free_velocity(self, tool, h):
        """v_free of (2)."""
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
        self._start = x, y, angle
        return free_x, free_y, free_w

    def _couple_tool(self, tool, _gravity, _damping, h):
        """Velocity update of the tool, called by Chipmunk between finding contacts and solving them."""
        self._free = free_x, free_y, free_w = self._free_velocity(tool, h)
        tool.velocity = free_x, free_y
        tool.angular_velocity = free_w

    def _limit_rebound(self, arbiter, _space, _data):
        """Restitution 0 where the push over this time would make the port active; called by Chipmunk for each pair."""
        e = arbiter.restitution
        if e == 0.0:
            return
        normal, point = arbiter.normal, arbiter.contact_point_set.points[0].point_a
        approach = change = 0.0
        for body, sign in zip(arbiter.bodies, (1.0, -1.0), strict=True):
            approach += sign * body.velocity_at_world_point(point).dot(normal)
            change += sign * self._change(body, point).dot(normal)
        if approach * (1.0 - e * e) < 2.0 * abs(change) * e:
            arbiter.restitution = 0.0

    def _change(self, body, point):
        """What forces without contacts add to the velocity of a body's point."""
        if body is self._tool:
            x, y, w = self._free_velocity(body, self.sub_step)
            (vx, vy), turn = body.velocity, w - body.angular_velocity
            arm = point - body.position
            return type(point)(x - vx - turn * arm.y, y - vy + turn * arm.x)
        return self.sub_step * self._space.gravity if body.mass < math.inf else type(point)(0.0, 0.0)

    def _read_tool(self):
        stiffness, damping, rotational_stiffness, rotational_damping = self._gains
        (hx, hy, ht), (hvx, hvy, hw) = self._handle
        (x, y, angle), h = self._start, self.sub_step
        vx, vy = self._tool.velocity
        w = self._tool.angular_velocity
        self.velocity = vx, vy, w
        self.position = x + self._move * vx, y + self._move * vy, angle + self._move * w
        x, y, angle = x + h * vx, y + h * vy, angle + h * w
        self.force_on_tool = (stiffness * (hx - x) + damping * (hvx - vx), stiffness * (hy - y) + damping * (hvy - vy),
                              rotational_stiffness * (ht - angle) + rotational_damping * (hw - w))
        self.touching = self.velocity != self._free and (not self._jointed or self._pushed())

    def _pushed(self):
        """Whether a contact pushed the tool, which joints push too."""
        return any(TOOL in (contact.body_a, contact.body_b) and contact.force_on_a != (0.0, 0.0)
                   for contact in self.contacts())

    def _contact(self, whole, real):
        body_a, body_b, count = whole
        points = [real[4:8], real[9:13]][:count]
        x = sum(ax + bx for ax, _, bx, _ in points) / (2 * count)
        y = sum(ay + by for _, ay, _, by in points) / (2 * count)
        depth = -min((real[8], real[13])[:count])
        a, b = self._order[body_a], self._order[body_b]
        sign = 1.0 if a < b else -1.0
        push = sign / self.sub_step
        normal = sign * real[2], sign * real[3]
        force_on_a = push * real[0], push * real[1]
        return Contact(min(a, b)[2], max(a, b)[2], (x, y), normal, force_on_a, depth)
