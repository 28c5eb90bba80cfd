# SPDX-License-Identifier: Apache-2.0
"""Who is how much faster at equal error: the smallest error that both reach, the least time in which each does.

On our side stands whichever of these methods is the fastest at that error.
"""

from typing import NamedTuple

from bench.methods.measure import Run
from bench.methods.world import PEERS
from reference.case import FREE, JOINTED, RICH, SINGLE

OURS = "closed_form", "partitioned", "event_driven"
WANTED = {JOINTED: 15.0, SINGLE: 5.0, RICH: 1.0, FREE: 1.0}


class Ratio(NamedTuple):
    """How many times faster `method` is than `peer` at `error`; times in s per simulated s."""

    scene: str
    kind: str
    method: str
    peer: str
    error: float
    wall: float
    peer_wall: float

    @property
    def ratio(self) -> float:
        """Times faster."""
        return self.peer_wall / self.wall

    @property
    def asked(self) -> bool:
        """Whether a ratio is asked of this pair: of mechanisms against MuJoCo's RK4, of the rest against every peer."""
        return self.peer == "mujoco_rk4" or self.kind != JOINTED

    @property
    def reached(self) -> bool:
        """Whether it is as fast as asked."""
        return self.ratio >= WANTED[self.kind]


def pareto(runs: list[Run]) -> list[Run]:
    """Runs that no other beats in both time and error, by falling error."""
    best, front = float("inf"), []
    for item in sorted((item for item in runs if item.counts), key=lambda item: (item.error, item.wall)):
        if item.wall < best:
            best = item.wall
            front.append(item)
    return front[::-1]


def ratios(runs: list[Run]) -> list[Ratio]:
    """One of ours on one scene against each peer that could do it."""
    own = [item for item in runs if item.method in OURS and item.counts]
    found = []
    for peer in PEERS:
        others = [item for item in runs if item.method == peer and item.counts]
        if own and others:
            error = max(min(item.error for item in own), min(item.error for item in others))
            mine, its = (
                min((item for item in side if item.error <= error), key=lambda item: item.wall)
                for side in (own, others)
            )
            found.append(Ratio(mine.scene, mine.kind, mine.method, peer, error, mine.wall, its.wall))
    return found
