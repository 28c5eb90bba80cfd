# SPDX-License-Identifier: Apache-2.0
"""Bodies of a pymunk Space that are so fast that a step could take them through something go up to it instead.

In one step a body may come a quarter of the least width of what it can meet, and no farther than 1.8 m/s take it in the
shortest step that so many bodies get: 90 µm, as deep as it may then be in it, of few. One that would come farther is
swept: the middle of each of its shapes as the disc that fits in, its corners as points, along straight ways. So are the
corners and discs of what it can meet, as they come towards its edges, seen from it. It goes to the first hit, where the
next step finds the contact, and loses the rest of the step. So does a body that comes to a stop of its joint.

What somebody has added to the space is taken in between two steps: all of it is met, and dynamic bodies are swept too.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import pymunk
from pymunk import batch

from haptic_sim.pymunk_world import swept_shapes
from haptic_sim.pymunk_world.joints import BEYOND, Stop
from haptic_sim.reduction.connected import connected
from haptic_sim.reduction.method_choice import short_step
from haptic_sim.reduction.model import Model
from haptic_sim.scene.geometry import Point, Pose, framed, turned

SHARE, FAST = 0.25, 1.8
"""Of the least width, that a step may take; m/s."""
STRUCK, RINGS = 300, 4
"""Iterations of the solver in the steps, that many, in which a stop is struck: what it leaves stays as speed, and
it begins the next step with the impulse of the stroke."""
SLOW = 0.1
"""m/s | rad/s; whoever is slower may be struck, and gets so fast until it is looked at anew."""
_RATES = batch.BodyFields.BODY_ID | batch.BodyFields.VELOCITY | batch.BodyFields.ANGULAR_VELOCITY
ALL = pymunk.ShapeFilter()

Swept = tuple[list[swept_shapes.Disc], float, float]
"""Discs that stand for a body, how far a step may take it, and its size [m]."""


class ContinuousCollision:
    """Moves of a space's bodies, between two steps of h [s]; `moves` are the times of those that differ from h.

    Unless `busy`, and while no point of the tool, `extent` [m] about its mass centre, is faster than `tool_fast` [m/s],
    there is nothing to `look` for.

    shapes: of the space, in the order of the model. model: of the scene. stops: of its joints.
    """

    def __init__(
        self,
        space: pymunk.Space,
        bodies: list[pymunk.Body],
        shapes: list[pymunk.Shape],
        model: Model,
        h: float,
        stops: list[Stop],
    ):
        self._space, self._h, self._scene = space, h, bodies
        self._near = 0.5 * space.collision_slop  # m; overlap at which a hit ends a move
        self._farthest = FAST * min(h, short_step(model))
        met = [_met(model, b) for b in range(len(bodies))]
        self._meets = [{shapes[s] for s in others} for others, _ in met]
        self._widths = dict(zip(shapes, model.thickness.tolist(), strict=True))
        self.added: dict[pymunk.Shape, float] = {}  # by somebody → least width
        points = [_points(model, b) for b in range(len(bodies))]
        limits = [min(SHARE * width, self._farthest) for _, width in met]
        self._own = list(zip(points, limits, model.extent[:-1].tolist(), strict=True))
        self._rates, self._stops = batch.Buffer(), stops
        self.moves: dict[int, float] = {}
        self._fast: list[int] = []
        self._stopping: list[Stop] = []
        self._struck, self._iterations = 0, space.iterations
        self._sweep(bodies, self._own)
        self._known, self.busy = self._contents(), False

    def _sweep(self, bodies: list[pymunk.Body], swept: list[Swept]) -> None:
        """From now on these bodies are swept."""
        self._points, limits, extents = zip(*swept, strict=True)
        self._bodies, rank = bodies, {body: b for b, body in enumerate(bodies)}
        ends = ((rank.get(joint.a, -1), rank.get(joint.b, -1)) for joint in self._space.constraints)
        self._linked = {b: group for group in connected(rank.values(), ends) for b in group}
        self._limits, self._extents, self._ids, self._order = np.array(limits), np.array(extents), b"", [0]
        # A body that is hit may leave with twice the speed of what hits it, and `watch` sees it some steps later.
        self._wary = 0.5 * self._limits / self._h
        self.extent, self.tool_fast = float(self._extents[0]), float(self._limits.min()) / self._h
        self.watches = bool(self._stops) or len(bodies) > 1

    def _contents(self) -> list[tuple[int, object]]:
        """What changes when something is added to the space or taken out of it."""
        kinds = self._space.shapes, self._space.bodies, self._space.constraints
        # Keys of dicts, which can be read from the end; pymunk's annotations promise less.
        return [(len(kind), next(reversed(kind), None)) for kind in kinds]  # type: ignore[call-overload]

    def take_in(self) -> None:
        """Takes note of what was added to the space, or taken out of it, since the last time."""
        contents = self._contents()
        if contents == self._known:
            return
        self._known, known = contents, self.added
        self.added = {
            shape: known.get(shape) or swept_shapes.width(shape)
            for shape in self._space.shapes
            if shape not in self._widths and not shape.sensor
        }
        there = (shape.body for shape in self.added if shape.body in self._space.bodies)
        bodies = list(dict.fromkeys([*self._scene, *(body for body in there if body.body_type == pymunk.Body.DYNAMIC)]))
        rank = {body: b for b, body in enumerate(bodies)}
        self.moves = {rank[self._bodies[b]]: move for b, move in self.moves.items() if self._bodies[b] in rank}
        own = self._own + [([], self._farthest, 0.0)] * (len(bodies) - len(self._scene))
        narrow = swept_shapes.narrowest(self.added), swept_shapes.narrowest(self.added | self._widths)
        self._sweep(bodies, [self._with_added(body, one, narrow) for body, one in zip(bodies, own, strict=True)])
        self._note_busy()

    def _with_added(self, body: pymunk.Body, own: Swept, narrow: Sequence[dict[pymunk.ShapeFilter, float]]) -> Swept:
        """How a body is swept, with what was added to it and beside it."""
        (points, limit, extent), centre = own, body.center_of_gravity
        more = [disc for shape in body.shapes if shape in self.added for disc in swept_shapes.discs(shape, centre)]
        limit = min(limit, SHARE * swept_shapes.least_met(body, narrow[bool(more)]))
        return [*points, *more], limit, max([extent, *(math.hypot(*place) + radius for place, radius in more)])

    def times(self) -> np.ndarray:
        """Times of the next move of the scene's bodies [s] (n, 1)."""
        times = np.full((len(self._bodies), 1), self._h)
        for b, move in self.moves.items():
            times[b] = move
        return times[: len(self._scene)]

    def watch(self, time: float) -> None:
        """Take note of who is fast, and who may come to a stop within a time [s]."""
        self._fast = np.flatnonzero(self._speeds(self._velocities()) > self._wary).tolist()
        self._stopping = []
        for stop in self._stops:
            way, rate = stop.ahead()
            if BEYOND < way < 2.0 * time * max(rate, SLOW):
                self._stopping.append(stop)
        for b in self._fast:  # somebody may have put it there, or thrown it, after the last step
            self._go(b)
        self._note_busy()

    def _speeds(self, velocities: np.ndarray) -> np.ndarray:
        """Of each body's fastest point, at most [m/s]."""
        return np.hypot(velocities[:, 0], velocities[:, 1]) + np.abs(velocities[:, 2]) * self._extents

    def look(self, vx: float, vy: float, turn: float, struck: bool) -> float:
        """Plans the next moves, the tool having this velocity after the step, in which it struck something or not.

        Returns the time of the tool's own move [s].
        """
        if abs(vx) + abs(vy) + abs(turn) * self.extent > self.tool_fast:
            if struck:
                self._fast = sorted({*self._fast, *self._far()})
            self._plan({0, *self._fast})
        elif self._fast:
            self._plan(self._fast)
        else:
            self.moves = {}
        if self._stopping or self._struck:
            self._go_to_stops()
        self._note_busy()
        return self.moves.get(0, self._h)

    def _note_busy(self) -> None:
        self.busy = bool(self.moves or self._fast or self._stopping or self._struck)

    def _far(self) -> list[int]:
        """Bodies that would come farther than they may in the next step."""
        return np.flatnonzero(self._h * self._speeds(self._velocities()) > self._limits).tolist()

    def _velocities(self) -> np.ndarray:
        """Of all bodies that are swept (n, 3)."""
        self._rates.clear()
        batch.get_space_bodies(self._space, _RATES, self._rates)
        ids = bytes(self._rates.int_buf())
        if ids != self._ids:  # the order changes with who is asleep
            rank = {number: row for row, number in enumerate(memoryview(ids).cast("P").tolist())}
            # One that a callback has taken out is left with somebody's until the next look.
            self._ids, self._order = ids, [rank.get(body.id, 0) for body in self._bodies]
        return np.frombuffer(self._rates.float_buf()).reshape(-1, 3)[self._order]

    def set_out(self) -> None:
        """Puts bodies where Chipmunk's move over h takes them to the end of theirs."""
        for b, move in self.moves.items():
            body = self._bodies[b]
            body.position += (move - self._h) * body.velocity
            body.angle += (move - self._h) * body.angular_velocity

    def _plan(self, some: Iterable[int]) -> None:
        """Fills in `moves` of some bodies, and of all that joints connect with them: else these would be torn open."""
        self.moves = {}
        for b in some:
            self._go(b)

    def _go(self, b: int) -> None:
        """Cuts the move of body b, should it be fast and meet something."""
        body, h = self._bodies[b], self._h
        (x, y), (vx, vy), angle, turn = body.position, body.velocity, body.angle, body.angular_velocity
        if h * (math.hypot(vx, vy) + abs(turn) * self._extents[b]) > self._limits[b]:
            if b >= len(self._scene):  # those have their mass centre where it is
                x, y = body.local_to_world(body.center_of_gravity)
            self._cut(b, h * self._free(b, (x, y, angle), (x + h * vx, y + h * vy, angle + h * turn)))

    def _go_to_stops(self) -> None:
        """Cuts the moves of bodies that would pass a stop, which is struck in the next step."""
        for stop in self._stopping:
            move = stop.time_left()
            self._cut(stop.body, move)
            if move < self._h:
                self._struck = RINGS
        self._struck = max(0, self._struck - 1)
        self._space.iterations = STRUCK if self._struck else self._iterations

    def _cut(self, b: int, move: float) -> None:
        """Lets body b, and all that joints connect with it, move no longer than this [s]."""
        for other in self._linked[b] if move < self._h else ():
            self.moves[other] = min(move, self.moves.get(other, self._h))

    def _free(self, b: int, here: Pose, there: Pose) -> float:
        """Share of a body's move that hits nothing: 1, or less."""
        share = 1.0
        for point, radius in self._points[b]:
            start, end = turned(point, here), turned(point, there)
            way = math.dist(start, end)
            if way > self._limits[b]:
                share = min([share, *(alpha + self._near / way for alpha in self._hits(b, start, end, radius))])
        return min([share, *self._edge_hits(b, here, there)])

    def _hits(self, b: int, start: Point, end: Point, radius: float) -> list[float]:
        """Shares of a disc's way at which it meets what body b can meet; where it overlaps at the start is no hit."""
        found = self._space.segment_query(start, end, radius, ALL)
        return [hit.alpha for hit in found if hit.alpha > 0.0 and self._can_meet(b, hit.shape)]

    def _edge_hits(self, b: int, here: Pose, there: Pose) -> Iterator[float]:
        """Shares of a body's move at which its edges meet corners or discs of what it can meet: it sees them come."""
        own = [shape for shape in self._bodies[b].shapes if not (shape.sensor or isinstance(shape, pymunk.Circle))]
        if not own:
            return
        around = swept_shapes.passed(own, here, there, self._extents[b])
        for other in self._space.bb_query(around, ALL):
            for corner, radius in swept_shapes.places(other, around) if self._can_meet(b, other) else ():
                end = turned(framed(corner, there), here)
                found = (shape.segment_query(corner, end, radius) for shape in own)
                way = math.dist(corner, end)
                yield from (hit.alpha + self._near / way for hit in found if hit and hit.alpha > 0.0)

    def _can_meet(self, b: int, shape: pymunk.Shape) -> bool:
        """Whether body b can meet a shape: in the scene as was worked out before, else as pymunk says now."""
        if not self.added:
            return shape in self._meets[b]
        body, added = self._bodies[b], self.added
        if b < len(self._scene) and shape in self._meets[b]:
            return True
        own = [one for one in body.shapes if one in added or shape in added]
        return swept_shapes.can_meet(body, own, shape, self._space.constraints)


def _points(model: Model, b: int) -> list[swept_shapes.Disc]:
    """Discs that stand for a body: (place in its frame, radius)."""
    found = []
    for s in np.flatnonzero(model.shape_body == b):
        corners = model.vertices[model.shape_start[s] : model.shape_start[s + 1]].tolist()
        if model.radius[s] > 0.0:
            found.append((corners[0], float(model.radius[s])))
        else:
            middle = np.mean(corners, axis=0).tolist()
            found += [(middle, swept_shapes.fits(corners, middle)), *((corner, 0.0) for corner in corners)]
    return found


def _met(model: Model, b: int) -> tuple[list[int], float]:
    """Shapes of the model that a body can meet, and the least of their widths [m]."""
    here = model.pair_bodies == b
    pairs, here = model.pairs[here.any(axis=1)], here[here.any(axis=1)]
    others = pairs[~here]
    return others.tolist(), float(model.thickness[others].min(initial=math.inf))
