# SPDX-License-Identifier: Apache-2.0
"""Bodies of a pymunk Space that are so fast that a step could take them through something go up to it instead.

In one step a body may come a quarter of the least width of what it can meet, at no more than 1.8 m/s, which is below
.1 mm in 50 µs. One that would come farther is swept: the middle of each of its shapes as the disc that fits in, its
corners as points, along straight ways. It goes to the first hit, where the next step finds the contact, and loses the
rest of the step. So does a body that comes to a stop of its joint.
"""

import math

import numpy as np
import pymunk
from pymunk import batch

from haptic_sim.geometry import turned
from haptic_sim.joints import BEYOND, Stop

SHARE, FAST = 0.25, 1.8
"""Of the least width, that a step may take; m/s."""
STRUCK, RINGS = 300, 4
"""Iterations of the solver in the steps, that many, in which a stop is struck: what it leaves stays as speed, and
it begins the next step with the impulse of the stroke."""
SLOW = 0.1
"""m/s | rad/s; whoever is slower may be struck, and gets so fast until it is looked at anew."""
_RATES = batch.BodyFields.BODY_ID | batch.BodyFields.VELOCITY | batch.BodyFields.ANGULAR_VELOCITY
ALL = pymunk.ShapeFilter()


class Sweep:
    """Moves of a space's bodies, between two steps of h [s]; `moves` are the times of those that differ from h.

    `near` [m] is the overlap at which a hit ends a move. shapes: of the space, in the order of the model. model and
    layout: as reduced from the scene. stops: of its joints.
    """

    def __init__(
        self,
        space: pymunk.Space,
        bodies: list[pymunk.Body],
        shapes,
        model,
        layout,
        h: float,
        near: float,
        stops: list[Stop],
    ):
        self._space, self._bodies, self._h, self._near = space, bodies, h, near
        self._points = [_points(model, b) for b in range(len(bodies))]
        met = [_met(model, layout, b) for b in range(len(bodies))]
        self._meets = [{shapes[s] for s in others} for others, _ in met]
        self._limits = np.array([min(SHARE * width, FAST * h) for _, width in met])
        self._extents = layout.extent[:-1].copy()
        self._linkage = layout.linkage.tolist()
        self._linked = [np.flatnonzero(layout.linkage == linkage).tolist() for linkage in range(max(self._linkage) + 1)]
        self._rates, self._ids, self._order = batch.Buffer(), None, None
        # A body that is hit may leave with twice the speed of what hits it, and `watch` sees it some steps later.
        self._wary = 0.5 * self._limits / h
        self._tool_fast = float(self._limits.min()) / h
        self._stops, self.watches = stops, bool(stops) or len(bodies) > 1
        self.moves, self._fast, self._stopping, self._struck = {}, [], [], 0
        self._iterations = space.iterations

    def times(self):
        """Times of the next move [s] (n, 1)."""
        times = np.full((len(self._bodies), 1), self._h)
        for b, move in self.moves.items():
            times[b] = move
        return times

    def watch(self, velocities: np.ndarray, time: float) -> None:
        """Take note of who is fast, at velocities (n, 3), and who may come to a stop within a time [s]."""
        self._fast = np.flatnonzero(self._speeds(velocities) > self._wary).tolist()
        self._stopping = []
        for stop in self._stops:
            way, rate = stop.ahead()
            if BEYOND < way < 2.0 * time * max(rate, SLOW):
                self._stopping.append(stop)

    def _speeds(self, velocities):
        """Of each body's fastest point, at most [m/s]."""
        return np.hypot(velocities[:, 0], velocities[:, 1]) + np.abs(velocities[:, 2]) * self._extents

    def look(self, vx: float, vy: float, turn: float, struck: bool) -> float:
        """Plans the next moves, the tool having this velocity after the step, in which it struck something or not.

        Returns the time of the tool's own move [s].
        """
        if abs(vx) + abs(vy) + abs(turn) * self._extents[0] > self._tool_fast:
            if struck:
                self._fast = sorted({*self._fast, *self._far()})
            self._plan({0, *self._fast})
        elif self._fast:
            self._plan(self._fast)
        else:
            self.moves = {}
        if self._stopping or self._struck:
            self._go_to_stops()
        return self.moves.get(0, self._h)

    def _far(self):
        """Bodies that would come farther than they may in the next step."""
        self._rates.clear()
        batch.get_space_bodies(self._space, _RATES, self._rates)
        ids = bytes(self._rates.int_buf())
        if ids != self._ids:  # the order changes with who is asleep
            rank = {number: row for row, number in enumerate(memoryview(ids).cast("P").tolist())}
            self._ids, self._order = ids, [rank[body.id] for body in self._bodies]
        velocities = np.frombuffer(self._rates.float_buf()).reshape(-1, 3)[self._order]
        return np.flatnonzero(self._h * self._speeds(velocities) > self._limits).tolist()

    def set_out(self) -> None:
        """Puts bodies where Chipmunk's move over h takes them to the end of theirs."""
        for b, move in self.moves.items():
            body = self._bodies[b]
            body.position += (move - self._h) * body.velocity
            body.angle += (move - self._h) * body.angular_velocity

    def _plan(self, some):
        """Fills in `moves` of some bodies, and of all that joints connect with them: else these would be torn open."""
        self.moves, h = {}, self._h
        for b in some:
            body = self._bodies[b]
            (x, y), (vx, vy), angle, turn = body.position, body.velocity, body.angle, body.angular_velocity
            if h * (math.hypot(vx, vy) + abs(turn) * self._extents[b]) > self._limits[b]:
                move = h * self._free(b, (x, y, angle), (x + h * vx, y + h * vy, angle + h * turn))
                self._cut(b, move)

    def _go_to_stops(self):
        """Cuts the moves of bodies that would pass a stop, which is struck in the next step."""
        for stop in self._stopping:
            move = stop.time_left()
            self._cut(stop.body, move)
            if move < self._h:
                self._struck = RINGS
        self._struck = max(0, self._struck - 1)
        self._space.iterations = STRUCK if self._struck else self._iterations

    def _cut(self, b, move):
        """Lets body b, and all that joints connect with it, move no longer than this [s]."""
        for other in self._linked[self._linkage[b]] if move < self._h else ():
            self.moves[other] = min(move, self.moves.get(other, self._h))

    def _free(self, b, here, there):
        """Share of a body's move that hits nothing: 1, or less."""
        share = 1.0
        for point, radius in self._points[b]:
            start, end = turned(point, here), turned(point, there)
            way = math.dist(start, end)
            if way > self._limits[b]:
                share = min([share, *(alpha + self._near / way for alpha in self._hits(b, start, end, radius))])
        return share

    def _hits(self, b, start, end, radius):
        """Shares of a disc's way at which it meets what body b can meet; where it overlaps at the start is no hit."""
        found = self._space.segment_query(start, end, radius, ALL)
        return [hit.alpha for hit in found if hit.alpha > 0.0 and hit.shape in self._meets[b]]


def _points(model, b):
    """Discs that stand for a body: (place in its frame, radius)."""
    found = []
    for s in np.flatnonzero(model.shape_body == b):
        corners = model.vertices[model.shape_start[s] : model.shape_start[s + 1]].tolist()
        if model.radius[s] > 0.0:
            found.append((corners[0], float(model.radius[s])))
        else:
            middle = np.mean(corners, axis=0).tolist()
            found += [(middle, _fits(corners, middle)), *((corner, 0.0) for corner in corners)]
    return found


def _fits(corners, middle):
    """Radius of the disc about `middle` that fits into a convex polygon."""
    edges = zip(corners, corners[1:] + corners[:1], strict=True)
    return min(
        abs((bx - ax) * (middle[1] - ay) - (by - ay) * (middle[0] - ax)) / math.hypot(bx - ax, by - ay)
        for (ax, ay), (bx, by) in edges
    )


def _met(model, layout, b):
    """Shapes of the model that a body can meet, and the least of their widths [m]."""
    here = layout.pair_bodies == b
    pairs, here = model.pairs[here.any(axis=1)], here[here.any(axis=1)]
    others = pairs[~here]
    return others.tolist(), float(layout.thickness[others].min(initial=math.inf))
