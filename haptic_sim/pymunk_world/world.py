# SPDX-License-Identifier: Apache-2.0
"""The method `impulse`: the scene as a pymunk Space in short equal steps, the coupling solved together with contacts.

The coupling, by backward difference. Over a step h the tool (mass m, velocity v, position x at its start) obeys

    m (v⁺ − v) = h m g + h [K (x_h⁺ − x⁺) + B (v_h⁺ − v⁺)] + J,        x⁺ = x + h v⁺                    (1)

with the handle x_h⁺, v_h⁺ at the END of the step and J the impulse of contacts and joints. Insert x⁺ and collect v⁺:

    m_e (v⁺ − v) = h [m g + K (x_h⁺ − x − h v) + B (v_h⁺ − v)] + J,     m_e = m + h B + h² K              (2)

So the tool enters Chipmunk's solver with the mass m_e and the force in brackets: impulses act through 1/m_e, which is
what the coupling lets the tool move. No term of (1) is explicit, so no K, B, h makes it unstable. Rotation likewise
with I, K_θ, B_θ; the grip is the mass centre, so the two do not mix. Limits: K = B = 0 is the free body; h → 0 is
m v̇ = m g + K (x_h − x) + B (v_h − v) + f_contact; h²K ≫ m gives x⁺ = x_h⁺. Over a step (1) loses ½ m |v⁺ − v|²: the
price of first order, ω h/2 of a mode ω, and what makes it passive at the port for every K, B, h.

Short steps. Chipmunk sees a contact only where shapes overlap. A sub-step is taken in equal steps, as short as
the scene asks for (reduction/method_choice.py): an overlap is no deeper than the way of one, and the error of (1)
shrinks with it. Equal, because Chipmunk scales the impulses that it remembers by the ratio of two steps, which creates
energy. Only what is so fast that it would come through something within a step is swept.

Chipmunk's own order. `Space.step` first moves bodies with the velocity of the step before (and its push-out velocity),
then finds contacts there, then updates velocities, then solves. The end of our step, x⁺ = x + h v⁺, is therefore where
the next one will look; push-out of overlaps enters as x of the next step.

Passivity. The work of the coupling is booked with the force of (1) and the way that the tool really came. Where push-
out moves the tool against that force it gives energy at the port: no more than ½ m |v⁺ − v|² has lost there before,
the rest of the overlap stays. How far the tool rebounds: `rebound`.
"""

import math
from typing import NamedTuple

import numpy as np
import pymunk
from pymunk import batch

from haptic_sim.protocol import Contact, Coupling, Planar, StepResult
from haptic_sim.pymunk_world.continuous_collision import ContinuousCollision
from haptic_sim.pymunk_world.joints import stored
from haptic_sim.pymunk_world.rebound import passive_rebound
from haptic_sim.pymunk_world.space import OWN_KINDS, Touching, fill
from haptic_sim.reduction import ReducedScene
from haptic_sim.reduction.model import energy_of

WATCH = 4
"""Sub-steps after which is looked anew who is fast."""
TOUCH = 1e-12
"""N s; impulse on the tool that is more than rounding."""
SET_FORCE, SET_TORQUE = (vars(pymunk.Body)[name].fset for name in ("force", "torque"))
"""Setters, in half the time of an assignment."""

_BODY = batch.BodyFields
_PLACES = _BODY.BODY_ID | _BODY.POSITION | _BODY.ANGLE | _BODY.VELOCITY | _BODY.ANGULAR_VELOCITY


class Energies(NamedTuple):
    """Sums over equal steps [J]; spare: lost at the tool and not yet given back by push-out, since the reset."""

    supplied: float
    numerical: float
    correction: float
    spare: float


class PymunkWorld:
    """The method `impulse`: the scene as `space`, a pymunk.Space in SI units, stepped by `sub_step` [s]. A `World`.

    You can add bodies, constraints and collision callbacks to the space. They are simulated like those of the scene,
    until the next reset. The docstring of this module explains the model.

    Args:
        reduced: the scene.
        sub_step: [s].

    Attributes:
        space: the pymunk.Space.

    Examples:
        >>> import pymunk
        >>> from haptic_sim.protocol import held
        >>> from haptic_sim.pymunk_world.world import PymunkWorld
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> world = PymunkWorld(reduce_scene(load("free_space"), "impulse"), 0.001)
        >>> own = pymunk.Body(0.02, 1e-6)  # [kg], [kg m²]
        >>> own.position, own.velocity = (0.05, 0.0), (0.1, 0.0)  # [m], [m/s]
        >>> world.space.add(own, pymunk.Circle(own, 0.002))
        >>> _ = world.step(held((0.0, 0.0, 0.0)), 100)
        >>> round(own.position.x, 6)  # 0.1 m/s for 0.1 s
        0.06
    """

    passive = False

    def __init__(self, reduced: ReducedScene, sub_step: float):
        self.scene, self.sub_step, self._reduced = reduced.scene, sub_step, reduced
        self.inner = math.ceil(sub_step / reduced.inside - 1e-9)
        self._h = sub_step / self.inner
        self._gravity, (self._mass, self._inertia, _) = self.scene.gravity, self.scene.tool.mass_properties
        self._gains = Coupling()
        self._places = batch.Buffer()
        self.reset()

    def reset(self) -> None:
        """Puts everything back to the scene's start, with the same gains; removes what was added to the space."""
        filled, model = fill(self._reduced, self._h), self._reduced.model
        self.space, self._bodies, self._tool = filled.space, filled.bodies, filled.bodies[0]
        self._dampers, stops = filled.joints
        self._turning = [damper for damper in self._dampers if damper.turns]
        self._touching, self._jointed, self._met = Touching(filled, self._h), False, 0.0
        self._restitution, self._calms = filled.restitution, False
        if any(filled.restitution.values()):
            self.space.on_collision(begin=self._begin_rebound)
        self._sweep = ContinuousCollision(self.space, self._bodies, filled.shapes, model, self._h, stops)
        self._unwatched = WATCH  # sub-steps
        self._spare = 0.0  # J, lost at the tool and not yet given back by push-out
        self.position: Planar = self.scene.tool.pose
        self.velocity: Planar = self.scene.tool.velocity
        self.force_on_tool: Planar = (0.0, 0.0, 0.0)
        self.touching = False
        self._state: np.ndarray | None = None  # of the end of the sub-step, once somebody has asked
        self._energy: tuple[float, float] | None = None
        self._ids: list[int] = []  # bodies in Chipmunk's order
        self._rows: list[int] = []  # their places in it
        self._set_effective_mass()

    def body(self, name: str) -> pymunk.Body:
        """The body of the space that a movable body of the scene belongs to; its position is its mass centre's."""
        return self._bodies[self._reduced.places[name].body]

    def couple(self, coupling: Coupling) -> None:
        """Take these gains from the next sub-step on; ValueError if one is negative or not finite."""
        self._gains = coupling.checked()
        self._set_effective_mass()

    def step(self, target: np.ndarray, n: int) -> StepResult:
        """Advance `n` sub-steps from each row of the handle's way (m, 6: position, velocity) evenly to the next."""
        first, second, *others = target.tolist()
        made = self._travel(first, second, n)
        for start, end in zip((second, *others), others, strict=False):
            made = made.then(self._travel(start, end, n))
        return made

    def _travel(self, start: list[float], end: list[float], count: int) -> StepResult:
        """`count` sub-steps, the handle on a straight line between two rows."""
        if count == 0:
            return StepResult(numerical=0.0)
        self._tool.activate()
        self._sweep.take_in()
        if self._sweep.added:
            self._unwatched = WATCH  # whoever did may have thrown it since
            self._calm()
        for damper in self._turning:
            damper.set_for(self._h)
        if self._tool.constraints and not self._jointed:
            self._jointed = True  # its change of velocity does not tell of contacts any more
            self.space.on_collision(OWN_KINDS, None, post_solve=self._note_contact)
        pull, last = self._pull(*start), self._pull(*end)
        rise = [(b - a) / (count * self.inner) for a, b in zip(pull, last, strict=True)]
        (supplied, numerical, correction, self._spare), push, touched = self._sub_steps(pull, rise, count)
        pressed, depth = self._touching.worst() if touched or len(self._bodies) > 1 else (0.0, 0.0)
        return StepResult(supplied, touched, max(push / self.sub_step, pressed), depth, 0, 0.0, correction, numerical)

    def _look_around(self) -> None:
        """Takes in what was added to the space, and who is fast."""
        self._unwatched = 0
        self._sweep.take_in()
        if self._sweep.watches:
            self._sweep.watch(WATCH * self.sub_step)

    def _pull(self, hx: float, hy: float, angle: float, vx: float, vy: float, turn: float) -> Planar:
        """K x_h + B v_h of each axis."""
        stiff, damping, turning, turning_damping = self._gains
        return stiff * hx + damping * vx, stiff * hy + damping * vy, turning * angle + turning_damping * turn

    def _sub_steps(self, pull: Planar, rise: list[float], count: int) -> tuple[Energies, float, bool]:
        """Equal steps of `count` sub-steps; `pull` of the handle before them, and by how much it changes in a step.

        Returns what the coupling supplied, what it lost by backward difference while nothing else pushed the tool, what
        push-out put in and what is spare; the largest impulse of contacts on the tool in a sub-step [N s]; whether
        there was any. Its locals, as in (1) and (2) above; _ stands for _x, _y, _t:

        fixed  K stiff, turning; B damping, turning_damping; m_e heavy, hard_to_turn; h K + B spring, rotor; m g weight_
        kept   pull_ and its rise_; x, y, angle; vx, vy, w; of a sub-step: sum_ of the force, push_ of J, its least
        step   force fx, fy, torque; v⁺ ux, uy, turn; v⁺ − v ax, ay, aw; J jx, jy, jw; x⁺ px, py, to; its time move
        """
        h, tool, sweep, space_step = self._h, self._tool, self._sweep, self.space.step
        stiff, damping, turning, turning_damping = self._gains
        mass, inertia, heavy, hard_to_turn = self._mass, self._inertia, tool.mass, tool.moment
        (gx, gy), (less_x, less_y) = self._gravity, self._less
        fall_x, fall_y, weight_x, weight_y = h * heavy * gx, h * heavy * gy, mass * gx, mass * gy
        spring, rotor, half, half_turn = h * stiff + damping, h * turning + turning_damping, 0.5 * mass, 0.5 * inertia
        (pull_x, pull_y, pull_t), (rise_x, rise_y, rise_t) = pull, rise
        (x, y, angle), (vx, vy, w) = self.position, self.velocity
        supplied = numerical = correction = largest = 0.0
        touched, spare, steps = False, self._spare, range(self.inner)
        for _ in range(count):
            if self._unwatched >= WATCH:
                self._look_around()
            self._unwatched += 1
            sum_x = sum_y = sum_t = push_x = push_y = 0.0
            touching, least = False, TOUCH * (1.0 + mass * (abs(vx) + abs(vy)))
            for _ in steps:
                pull_x, pull_y, pull_t = pull_x + rise_x, pull_y + rise_y, pull_t + rise_t
                # K (x_h - x) + B v_h - (h K + B) v, and what Chipmunk's gravity pulls too much
                fx = pull_x - stiff * x - spring * vx - less_x
                fy = pull_y - stiff * y - spring * vy - less_y
                torque = pull_t - turning * angle - rotor * w
                SET_FORCE(tool, (fx, fy))
                SET_TORQUE(tool, torque)
                if sweep.moves:
                    sweep.set_out()
                space_step(h)
                (ux, uy), turn = tool.velocity, tool.angular_velocity
                ax, ay, aw = ux - vx, uy - vy, turn - w
                jx, jy, jw = heavy * ax - h * fx - fall_x, heavy * ay - h * fy - fall_y, hard_to_turn * aw - h * torque
                fx, fy, torque = fx + less_x - spring * ax, fy + less_y - spring * ay, torque - rotor * aw
                lost = half * (ax * ax + ay * ay) + half_turn * aw * aw
                struck = abs(jx) + abs(jy) > least or abs(jw) > least
                if struck:
                    touching, push_x, push_y = True, push_x + jx, push_y + jy
                    numerical += lost if self._jointed else 0.0
                    spare += max(0.0, lost - max(0.0, jx * ux + jy * uy + jw * turn))
                else:
                    numerical += lost
                    spare += lost
                (px, py), to = tool.position, tool.angle
                if px != x or py != y or to != angle:
                    (px, py, to), spare = self._push_out((x, y, angle), (px, py, to), (fx, fy, torque), spare)
                    correction -= (fx + weight_x) * (px - x) + (fy + weight_y) * (py - y) + torque * (to - angle)
                move = h
                if sweep.busy or abs(ux) + abs(uy) + abs(turn) * sweep.extent > sweep.tool_fast:
                    move = sweep.look(ux, uy, turn, struck)
                px, py, to = px + move * ux, py + move * uy, to + move * turn
                supplied += fx * (px - x) + fy * (py - y) + torque * (to - angle)
                if move < h:  # the way that is lost was paid for
                    supplied += max(0.0, (h - move) * (fx * ux + fy * uy + torque * turn))
                sum_x, sum_y, sum_t = sum_x + fx, sum_y + fy, sum_t + torque
                x, y, angle, vx, vy, w = px, py, to, ux, uy, turn
            push = math.hypot(push_x, push_y)
            if self._jointed:
                touching, push, self._met = self._met > 0.0, self._met, 0.0
            touched, largest = touched or touching, max(largest, push)
        self.position, self.velocity, self._state = (x, y, angle), (vx, vy, w), None
        self.touching = touching
        self.force_on_tool = sum_x / self.inner, sum_y / self.inner, sum_t / self.inner
        return Energies(supplied, numerical, correction, spare), largest, touched

    def _note_contact(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
        """Adds up what contacts push a jointed tool by [N s]; called by Chipmunk for each that does."""
        self._met += abs(arbiter.total_impulse)

    def _push_out(self, wanted: Planar, found: Planar, force: Planar, spare: float) -> tuple[Planar, float]:
        """Where the tool is left that Chipmunk has pushed out to `found`: it gives no more at the port than is spare.

        Returns that place, and what is spare then [J].
        """
        out = [b - a for a, b in zip(wanted, found, strict=True)]
        gives = -sum(f * d for f, d in zip(force, out, strict=True))
        if gives > spare:
            share, gives = spare / gives, spare
            x, y, angle = (a + share * d for a, d in zip(wanted, out, strict=True))
            self._tool.position, self._tool.angle, found = (x, y), angle, (x, y, angle)
        return found, spare - max(0.0, gives)

    def contacts(self) -> list[Contact]:
        """Contacts of the last step, sorted by bodies and place; bodies asleep have none."""
        return self._touching.contacts()

    def bodies(self) -> list[tuple[Planar, Planar]]:
        """Pose and velocity of every moving body's mass centre, as in the reduced model."""
        return [(tuple(row[:3]), tuple(row[3:])) for row in self._now().tolist()]

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame at the end of the sub-step."""
        place = self._reduced.places[body]
        return place.pose if place.body == len(self._bodies) else place.at(self._now()[place.body, :3].tolist())

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of the scene's bodies and springs [J]; gravity's is 0 at the origin."""
        if self._state is None or self._energy is None:
            self._energy = self._energy_of(self._now())
        return self._energy

    def _energy_of(self, state: np.ndarray) -> tuple[float, float]:
        model = self._reduced.model
        kinetic, potential = energy_of(model, state[:, :3], state[:, 3:])
        if len(model.joint_kind):
            potential += stored(model, [tuple(row) for row in state[:, :3].tolist()])
        return kinetic, potential

    def _now(self) -> np.ndarray:
        """Mass centres and velocities (n, 6) of the movable bodies at the end of the sub-step."""
        if self._state is None:
            self._places.clear()
            batch.get_space_bodies(self.space, _PLACES, self._places)
            ids = memoryview(self._places.int_buf()).cast("P").tolist()
            if ids != self._ids:  # the order changes with who is asleep
                rank = {number: row for row, number in enumerate(ids)}
                self._ids, self._rows = ids, [rank[body.id] for body in self._bodies]
            self._energy, self._state = None, np.frombuffer(self._places.float_buf()).reshape(-1, 6)[self._rows]
            state = self._state
            state[:, :3] += self._sweep.times() * state[:, 3:]
        return self._state

    def _set_effective_mass(self) -> None:
        stiffness, damping, rotational_stiffness, rotational_damping = self._gains
        h = self._h
        extra = h * damping + h * h * stiffness
        self._tool.mass = self._mass + extra
        self._less = extra * self._gravity[0], extra * self._gravity[1]  # Chipmunk's gravity pulls m_e
        self._tool.moment = self._inertia + h * rotational_damping + h * h * rotational_stiffness
        for damper in self._dampers:
            damper.set_for(h)

    def _begin_rebound(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
        """Restitution of two that meet: with the tool, no more than keeps the port passive under its push.

        Chipmunk calls it in the step in which they do; from the next on the scene's own shapes have 0 again.
        """
        first, second = (self._restitution.get(shape, shape.elasticity) for shape in arbiter.shapes)
        wanted = first * second
        if wanted > 0.0 and self._tool in arbiter.bodies:
            wanted = min(wanted, self._passive_rebound(arbiter))
        arbiter.restitution = wanted

    def _calm(self) -> None:
        """Where the scene's shapes rebound, added ones rebound as they do: in the step alone in which two meet."""
        if not self._calms and any(self._restitution.values()) and any(one.elasticity for one in self._sweep.added):
            self._calms = True
            self.space.on_collision(begin=self._begin_rebound, pre_solve=_rest)

    def _passive_rebound(self, arbiter: pymunk.Arbiter) -> float:
        """Largest coefficient of restitution of a contact of the tool that the coupling leaves passive."""
        tool, point = self._tool, arbiter.contact_point_set.points[0].point_a
        a, b = arbiter.bodies
        normal, other = (arbiter.normal, b) if a is tool else (-arbiter.normal, a)  # from the tool
        approach = (tool.velocity_at_world_point(point) - other.velocity_at_world_point(point)).dot(normal)
        if approach <= 0.0:
            return 0.0
        arm = (point - tool.position).cross(normal)
        row = np.array((normal.x, normal.y, arm))
        push = self._h * np.array((*(tool.force + self._less), tool.torque))  # without gravity
        softness = 1.0 / np.array((tool.mass, tool.mass, tool.moment))
        true = np.array((self._mass, self._mass, self._inertia)) * softness**2
        others = 0.0
        if other.body_type == pymunk.Body.DYNAMIC:
            others = 1.0 / other.mass + (point - other.position).cross(normal) ** 2 / other.moment
        return passive_rebound(
            approach,
            float(row @ (softness * push)),
            float(row**2 @ softness) + others,
            (float(push @ (true * push)), float(row @ (true * push)), float(row**2 @ true) + others),
        )


def _rest(arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
    """Restitution 0 of what touched before."""
    if not arbiter.is_first_contact:
        arbiter.restitution = 0.0
