# SPDX-License-Identifier: Apache-2.0
"""A scene as a pymunk Space: bodies, shapes, layers, joints, and what its contacts say after a step."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pymunk
from pymunk import batch

from haptic_sim.protocol import Contact
from haptic_sim.pymunk_world.joints import Tended, add_joints
from haptic_sim.reduction import ReducedScene
from haptic_sim.reduction.method_choice import LAYERS, too_many_layers
from haptic_sim.reduction.model import Model
from haptic_sim.scene.geometry import Pose, turned
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL, AnySolid

SWEEPS = 30
"""Of Chipmunk's solver, for any number of bodies."""
SLOP, SLOP_SHARE = 3e-6, 0.01
"""Overlap that is left alone [m], at most this share of the finest feature: keeps a resting contact alive."""
BIAS = 1e-300
"""Chipmunk asks for the share of an overlap left after a second; less underflows to 0, which takes all back at once."""
ASLEEP, SLOW, HEAVY = 0.2, 1e-7, 0.05
"""s below m/s after which bodies at rest are left out until something touches them; gravity above which, m/s²."""
OWN_KINDS = 1 << 20
"""Collision types from here on are ours."""

_PAIR = batch.ArbiterFields
_WORST = _PAIR.BODY_A_ID | _PAIR.BODY_B_ID | _PAIR.CONTACT_COUNT | _PAIR.TOTAL_IMPULSE
_WORST |= _PAIR.DISTANCE_1 | _PAIR.DISTANCE_2
_FIELDS = _WORST | _PAIR.NORMAL | _PAIR.POINT_A_1 | _PAIR.POINT_B_1 | _PAIR.POINT_A_2 | _PAIR.POINT_B_2


class Filled(NamedTuple):
    """A space with a scene in it."""

    space: pymunk.Space
    bodies: list[pymunk.Body]
    """Those that can move, in the order of the model."""
    shapes: list[pymunk.Shape]
    """In the order of the model."""
    names: dict[int, tuple[int, str]]
    """Body id → its place in the scene, the tool's first, and its name; of the scene's own bodies alone."""
    joints: Tended
    restitution: dict[pymunk.Shape, float]
    """Root of each shape's coefficient: two that meet have the product, in the step in which they do; later 0."""


def fill(reduced: ReducedScene, h: float) -> Filled:
    """A new space with the scene at its start, to be stepped by h [s]. ValueError if it has too many layers."""
    scene, model = reduced.scene, reduced.model
    space = pymunk.Space()
    space.gravity, space.iterations = scene.gravity, SWEEPS
    space.collision_slop, space.collision_bias = min(SLOP, SLOP_SHARE * scene.feature), BIAS
    # A contact that returns within the persistence would keep an impulse it no longer applies, and could pull.
    space.collision_persistence = 1
    # What a joint, a belt or a weak gravity is about to move would fall asleep before it is SLOW.
    if math.hypot(*scene.gravity) > HEAVY and not len(model.joint_kind) and not np.any(model.pair_surface):
        space.sleep_time_threshold, space.idle_speed_threshold = ASLEEP, SLOW
    bodies = [_movable(space, model, b, h) for b in range(len(model.mass) - 1)]
    shapes, names = _add_solids(space, reduced, bodies)
    solids = (scene.solids[name] for name in reduced.shape_names)
    restitution = {shape: math.sqrt(scene.material(of).restitution) for shape, of in zip(shapes, solids, strict=True)}
    return Filled(space, bodies, shapes, names, add_joints(space, reduced, bodies), restitution)


def _layer_bits(scene: Scene) -> dict[int, int]:
    """Layer → bit of a filter; layers of one body alone, which what one adds can meet, as far as there are bits."""
    if refusal := too_many_layers(scene):
        raise ValueError(refusal)
    used = sorted({layer for solid in scene.solids.values() for layer in solid.layers} - set(scene.shared_layers))
    return {layer: 1 << bit for bit, layer in enumerate([*scene.shared_layers, *used][:LAYERS])}


def _movable(space: pymunk.Space, model: Model, b: int, h: float) -> pymunk.Body:
    """Body b of the model, where Chipmunk's first move over h takes it to its start."""
    body = pymunk.Body(float(model.mass[b]), float(model.inertia[b]))
    (x, y, angle), (vx, vy, turn) = model.pose[b].tolist(), model.velocity[b].tolist()
    body.position, body.angle = (x - h * vx, y - h * vy), angle - h * turn
    body.velocity, body.angular_velocity = (vx, vy), turn
    space.add(body)
    return body


def _add_solids(
    space: pymunk.Space, reduced: ReducedScene, bodies: list[pymunk.Body]
) -> tuple[list[pymunk.Shape], dict[int, tuple[int, str]]]:
    """All shapes of the scene in the order of the model, and the names of their bodies."""
    scene, bits = reduced.scene, _layer_bits(reduced.scene)
    kinds, names = {TOOL: OWN_KINDS}, dict[int, tuple[int, str]]()
    made: dict[str, Iterator[pymunk.Shape]] = {}
    for pair in scene.kept_apart:
        first, second = (kinds.setdefault(name, OWN_KINDS + len(kinds)) for name in sorted(pair))
        space.on_collision(first, second, begin=_let_pass)
    for rank, (name, solid) in enumerate(scene.solids.items()):
        place = reduced.places[name]
        if place.body < len(bodies):
            body = bodies[place.body]
        else:
            body = pymunk.Body(body_type=pymunk.Body.STATIC)
            space.add(body)
        names.setdefault(body.id, (rank, name))
        layers = sum(bits.get(layer, 0) for layer in solid.layers)
        made[name] = _add_shapes(space, scene, solid, body, place.pose, layers, kinds.get(name, 0))
    return [next(made[name]) for name in reduced.shape_names], names


def _add_shapes(
    space: pymunk.Space, scene: Scene, solid: AnySolid, body: pymunk.Body, pose: Pose, layers: int, kind: int
) -> Iterator[pymunk.Shape]:
    material, made = scene.material(solid), []
    turn = pymunk.Transform.translation(pose[0], pose[1]) @ pymunk.Transform.rotation(pose[2])
    for vertices, radius in solid.outlines:
        placed = [turn @ vertex for vertex in vertices]
        shape = pymunk.Circle(body, radius, placed[0]) if radius > 0.0 else pymunk.Poly(body, placed)
        # Chipmunk multiplies the two coefficients of a pair: roots make it their geometric mean. Elasticity stays 0.
        shape.friction = math.sqrt(material.friction)
        shape.filter = pymunk.ShapeFilter(categories=layers, mask=layers)
        if solid.name != TOOL:
            shape.surface_velocity = turned(solid.surface_velocity, (0.0, 0.0, solid.pose[2]))
        shape.collision_type = kind
        space.add(shape)
        made.append(shape)
    return iter(made)


def _let_pass(arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
    """Two that a joint holds together do not touch."""
    arbiter.process_collision = False


class Touching:
    """Contacts of a filled space's last step that press, of the scene's own bodies; h [s] is the step."""

    def __init__(self, filled: Filled, h: float):
        self._space, self._names, self._h, self._buffer = filled.space, filled.names, h, batch.Buffer()

    def contacts(self) -> list[Contact]:
        """Sorted by bodies and place; bodies asleep have none."""
        self._buffer.clear()
        batch.get_space_arbiters(self._space, _FIELDS, self._buffer)
        whole, push, real = self._numbers()
        press = push > 0.0
        return sorted(map(self._contact, whole[press].tolist(), real[press].tolist()))

    def worst(self) -> tuple[float, float]:
        """Largest force [N], and the depth [m] of the deepest."""
        self._buffer.clear()
        batch.get_space_arbiters(self._space, _WORST, self._buffer)
        if not len(self._buffer.int_buf()):
            return 0.0, 0.0
        whole, push, real = self._numbers()
        first, second = real[:, 2], real[:, 3]
        distances = np.where(whole[:, 2] > 1, np.minimum(first, second), first)
        return math.sqrt(push.max()) / self._h, -float(distances.min(where=push > 0.0, initial=0.0))

    def _numbers(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of all pairs: whole numbers (n, 3), the square of the impulse [N² s²] or 0 if not ours (n), real numbers."""
        whole = np.frombuffer(self._buffer.int_buf(), dtype=np.uintp).reshape(-1, 3)
        real = np.frombuffer(self._buffer.float_buf()).reshape(max(1, len(whole)), -1)[: len(whole)]
        push = np.square(real[:, :2]).sum(axis=1) * (whole[:, 2] > 0)
        if len(self._space.bodies) > len(self._names):  # somebody has added some
            push *= np.isin(whole[:, :2], list(self._names)).all(axis=1)
        return whole, push, real

    def _contact(self, whole: list[int], real: list[float]) -> Contact:
        body_a, body_b, count = whole
        points = [real[4:8], real[9:13]][:count]
        x = sum(ax + bx for ax, _, bx, _ in points) / (2 * count)
        y = sum(ay + by for _, ay, _, by in points) / (2 * count)
        depth = -min((real[8], real[13])[:count])
        a, b = self._names[body_a], self._names[body_b]
        sign = 1.0 if a < b else -1.0
        push = sign / self._h
        normal = sign * real[2], sign * real[3]
        force_on_a = push * real[0], push * real[1]
        return Contact(min(a, b)[1], max(a, b)[1], (x, y), normal, force_on_a, depth)
