# SPDX-License-Identifier: Apache-2.0
"""How much of a move is free: no pair of shapes goes through another, however thin, at any speed.

For methods that look for contacts only where they have arrived. A pair that is apart may move until it overlaps by
`NEAR`; one that touches already is held by the solver, and may sink in by `LEAST_WAY` more between two looks.
"""

import math

from haptic_sim.clearance import meeting
from haptic_sim.method.layout import lay_out
from haptic_sim.outline import Outline
from haptic_sim.shape import turned

LEAST_WAY = 2.5e-3
"""In widths of the thinner shape of a pair: shorter moves need no guard, this is all that they can overlap."""
NEAR = 2.5e-4
"""Overlap at which a move ends, in finest features: half of what the solver leaves alone."""
STILL = (0.0, 0.0, 0.0)


class Guard:
    """Pairs of shapes of a scene that can touch, as they move with their bodies."""

    def __init__(self, scene, compiled):
        model, layout = compiled.model, lay_out(compiled.model)
        self._near = NEAR * scene.feature
        self._extents = layout.extent.tolist()[:-1]
        self._world = len(model.mass) - 1
        outlines = [Outline(tuple(map(tuple, model.vertices[start:end].tolist())), float(radius)) for start, end, radius
                    in zip(model.shape_start[:-1], model.shape_start[1:], model.radius, strict=True)]
        self._pairs = [(int(model.shape_body[s]), int(model.shape_body[u]), outlines[s], outlines[u],
                        tuple(layout.middle[s].tolist()), tuple(layout.middle[u].tolist()),
                        float(layout.reach[s] + layout.reach[u]), float(layout.thickness[s] + layout.thickness[u]),
                        LEAST_WAY * float(min(layout.thickness[s], layout.thickness[u])))
                       for s, u in model.pairs.tolist()]
        self._least = 0.5 * min((pair[-1] for pair in self._pairs), default=math.inf)

    def share(self, bodies, time: float) -> float:
        """Share of the move over `time` [s], at the velocities that the bodies have, that is free: 1, or less."""
        ways = [time * (abs(body.velocity) + abs(body.angular_velocity) * extent)
                for body, extent in zip(bodies, self._extents, strict=True)]
        if max(ways) <= self._least:
            return 1.0
        ways.append(0.0)
        starts = [(*body.position, body.angle) for body in bodies] + [STILL]
        ends = [(x + time * body.velocity.x, y + time * body.velocity.y, angle + time * body.angular_velocity)
                for body, (x, y, angle) in zip(bodies, starts, strict=False)] + [STILL]
        return min((self._free(pair, ways, starts, ends) for pair in self._pairs), default=1.0)

    def _free(self, pair, ways, starts, ends):
        a, b, outline_a, outline_b, middle_a, middle_b, reach, thickness, least = pair
        way = ways[a] + ways[b]
        if way <= least:
            return 1.0
        if math.dist(turned(middle_a, starts[a]), turned(middle_b, starts[b])) - reach > way:
            return 1.0
        look = min(1.0, 0.25 * thickness / way)
        moves = outline_a, (starts[a], ends[a]), outline_b, (starts[b], ends[b])
        return meeting(*moves, look, self._near, least)
