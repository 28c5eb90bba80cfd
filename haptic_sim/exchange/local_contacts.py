# SPDX-License-Identifier: Apache-2.0
"""The contacts that a simulation sends along with its tool: what the servo's own tool may touch until the next set.

Features and their ranking: method/proximity. What another body gives way by comes from its mass and its joints. One
that the tool presses on already, or that dry friction or a motor holds in a joint, gives way by nothing: it moves as
the simulation says.
"""

import math

import numpy as np

from haptic_device.control import contact_model
from haptic_device.message_fields import AXES, EACH, MOST
from haptic_sim.method import proximity
from haptic_sim.protocol import World
from haptic_sim.reduction import ReducedScene
from haptic_sim.reduction.mobility import forbidden_rows
from haptic_sim.reduction.model import Model
from haptic_sim.scene.geometry import Point

THROUGH = 1e-4  # [m] into another body by which the tool's motion is foretold
NEAR = 2e-3  # [m] between a contact that pressed and the pair of features that it is taken for


class LocalContacts:
    """Contacts of a scene's tool as a world moves it; `table` is what the last `look` found."""

    def __init__(self, reduced: ReducedScene, world: World):
        model = reduced.model
        self._world, self._model, self._scene = world, model, reduced.scene
        self._names = reduced.shape_names
        self._features = tuple(getattr(model, name) for name in proximity.READ)
        self._pose, self._velocity = model.pose.copy(), model.velocity.copy()
        self._candidates = np.zeros((proximity.MOST, proximity.COLUMNS))
        self._free = [_mobility(model, body) for body in range(len(model.mass))]
        self._moving = [body for body in range(1, len(model.mass)) if not model.fixed[body]]
        kept = (model.joint_friction > 0.0) | (model.joint_motor[:, 1] > 0.0)
        self._kept = {int(body) for body in model.joint_bodies[kept].ravel()}
        of_tool = model.shape_body[model.pairs[:, 0]] == 0
        self._stands_in = not (model.joint_bodies == 0).any() and not model.pair_surface[of_tool].any()
        self._extent = max(
            math.hypot(x, y) + radius
            for shape, radius in enumerate(model.radius)
            if model.shape_body[shape] == 0
            for x, y in model.vertices[model.shape_start[shape] : model.shape_start[shape + 1]]
        )
        self.table, self.trust, self.offered = np.zeros((MOST, len(EACH))), 0.0, 0
        self.look(0.0)

    @property
    def common(self) -> dict[str, float]:
        """What a set says once: the tool, and where it is expected to be when the set is used."""
        mass, inertia, _ = self._scene.tool.mass_properties
        pose, (gx, gy) = self._expected, self._scene.gravity
        tool = {"mass": mass, "inertia": inertia, "extent": self._extent, "gravity_x": gx, "gravity_y": gy}
        place = {f"tool_pose_{axis}": value for axis, value in zip(AXES, pose, strict=True)}
        return {"offered": self.offered, "trust": self.trust, **tool, **place}

    def look(self, lag: float) -> None:
        """Finds the contacts as the bodies are now; lag [s]: how old the set will be when it is used."""
        for body, (pose, velocity) in enumerate(self._world.bodies()):
            self._pose[body], self._velocity[body] = pose, velocity
        lead, count = lag, self._find(lag)
        if count:
            lead = self._until_touch(lag, count)
            count = self._find(lead) if lead < lag else count
        self._expected = self._pose[0] + lead * self._velocity[0]
        self.offered = count
        self.trust = proximity.choose(self._candidates, count, self.table[:, contact_model.IDENTITY].copy(), self.table)
        if not self._stands_in or count >= proximity.MOST:
            self.trust = 0.0  # the servo knows no joints and no belts, or too little
        if self._moving:
            self._give_way()

    def _find(self, lead: float) -> int:
        return proximity.find(self._features, self._pose, self._velocity, lead, self._candidates)

    def _until_touch(self, lag: float, count: int) -> float:
        """How far ahead the tool goes as it does [s]: not through what it meets."""
        ways = self._candidates[:count, proximity.URGENCY]
        first = ways.argmin()
        gap, then = float(self._candidates[first, contact_model.GAP]), float(ways[first])
        if then >= -THROUGH or then >= gap:
            return lag
        return lag * max(0.0, (gap + THROUGH) / (gap - then))

    def _give_way(self) -> None:
        """Mobility of the bodies behind the contacts, and the force that the simulation's tool has on them."""
        body_of = self._model.shape_body
        contacts = self._world.contacts() if self._world.touching else []
        pressed = [one for one in contacts if one.body_a == "tool"]
        rubbed = {name for one in contacts if one.body_a != "tool" for name in (one.body_a, one.body_b)}
        for one in self.table:
            if one[contact_model.IDENTITY] == 0.0:
                continue
            body = int(body_of[self._other(one)])
            if body not in self._moving:
                continue
            name, (nx, ny) = self._names[self._other(one)], self._world_normal(one)
            place = one[contact_model.POINT_X], one[contact_model.POINT_Y]
            if one[contact_model.KIND] == contact_model.FLAT_THERE:
                place = self._foot(one)
            one[contact_model.FORCE] = sum(
                max(0.0, f.force_on_a[0] * nx + f.force_on_a[1] * ny)
                for f in pressed
                if f.body_b == name and math.dist(f.point, place) < NEAR
            )
            held = body in self._kept or (name in rubbed and any(f.body_b == name for f in pressed))
            one[contact_model.FORCE] *= held
            one[contact_model.MOBILITY] = 0.0 if held else self._mobility_along(body, place, nx, ny)
            one[contact_model.SLIP_MOBILITY] = 0.0 if held else self._mobility_along(body, place, -ny, nx)

    def _other(self, one: np.ndarray) -> int:
        """Shape of the other body of a contact: identities count pairs."""
        pair = int((one[contact_model.IDENTITY] - 1.0) // (2.0 * proximity.CORNERS * proximity.CORNERS))
        return self._model.pairs[pair, 1]

    def _world_normal(self, one: np.ndarray) -> Point:
        nx, ny = one[contact_model.NORMAL_X], one[contact_model.NORMAL_Y]
        if one[contact_model.KIND] != contact_model.FLAT_HERE:
            return nx, ny
        c, s = math.cos(self._pose[0, 2]), math.sin(self._pose[0, 2])
        return c * nx - s * ny, s * nx + c * ny

    def _foot(self, one: np.ndarray) -> Point:
        """Where the tool's point would touch the other body's plane."""
        c, s = math.cos(self._pose[0, 2]), math.sin(self._pose[0, 2])
        x = self._pose[0, 0] + c * one[contact_model.TOOL_X] - s * one[contact_model.TOOL_Y]
        y = self._pose[0, 1] + s * one[contact_model.TOOL_X] + c * one[contact_model.TOOL_Y]
        back = one[contact_model.GAP] + one[contact_model.RADIUS]
        return x - back * one[contact_model.NORMAL_X], y - back * one[contact_model.NORMAL_Y]

    def _mobility_along(self, body: int, place: Point, nx: float, ny: float) -> float:
        """Velocity [m/s] of a body's point along n for an impulse of 1 N s along n there [1/kg]."""
        free, (x, y, angle) = self._free[body], self._pose[body]
        c, s = math.cos(angle), math.sin(angle)
        arm = (place[0] - x) * ny - (place[1] - y) * nx
        push = np.array((c * nx + s * ny, c * ny - s * nx, arm))
        return float(push @ free @ push)


def _mobility(model: Model, body: int) -> np.ndarray:
    """Response (3, 3) of a body to impulses in its own frame: its mass, less what joints to fixed bodies take away."""
    if model.fixed[body]:
        return np.zeros((3, 3))
    free = np.diag([1.0 / model.mass[body], 1.0 / model.mass[body], 1.0 / model.inertia[body]])
    rows = [row for joint in range(len(model.joint_kind)) for row in _held(model, joint, body)]
    if not rows:
        return free
    held = np.array(rows)
    return free - free @ held.T @ np.linalg.pinv(held @ free @ held.T) @ held @ free


def _held(model: Model, joint: int, body: int) -> list[tuple[float, float, float]]:
    """Directions that a joint to a fixed body takes away, in the body's own frame at the start."""
    bodies = model.joint_bodies[joint].tolist()
    if body not in bodies or not model.fixed[bodies[1 - bodies.index(body)]]:
        return []
    c, s = math.cos(model.pose[body][2]), math.sin(model.pose[body][2])
    rows = [row[bodies.index(body)] for row in forbidden_rows(model, joint)]
    return [(c * x + s * y, c * y - s * x, turn) for x, y, turn in rows]
