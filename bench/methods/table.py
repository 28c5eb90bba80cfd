# SPDX-License-Identifier: Apache-2.0
"""Runs as one Markdown table, and who is how much faster at equal error.

That is the smallest error that both reach, and the least time in which each does; on our side stands whichever of these
methods is the fastest at that error.
"""

import math
from typing import NamedTuple

from bench.jobs import markdown as as_table
from bench.methods.measure import Run
from bench.methods.world import PEERS, title
from bench.reference.case import FREE, JOINTED, RICH, SINGLE, case
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

OURS = "closed_form", "partitioned", "event_driven"
AHEAD = 1.05  # times as fast: less is within the noise of a run
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


class Lead(NamedTuple):
    """Errors at which a peer is faster than the best of ours, and up to how many times: inf where none gets there."""

    scene: str
    peer: str
    least: float
    most: float
    times: float


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


def leads(runs: list[Run]) -> list[Lead]:
    """Peers that are ahead of ours somewhere, on one scene."""
    own = [item for item in runs if item.method in OURS and item.counts]
    found = []
    for peer in PEERS:
        ahead = {}
        for item in pareto([item for item in runs if item.method == peer]):
            times = min((mine.wall for mine in own if mine.error <= item.error), default=math.inf) / item.wall
            if times > AHEAD:
                ahead[item.error] = times
        if ahead:
            found.append(Lead(runs[0].scene, peer, min(ahead), max(ahead), max(ahead.values())))
    return found


def told_leads(runs: list[Run]) -> str:
    """A line for each peer and scene where the peer is ahead, in words."""
    found = [lead for of_scene in by_scene(runs).values() for lead in leads(of_scene)]
    return "\n".join(
        f"* {title(lead.peer)} on `{lead.scene}` "
        + (
            f"at an error of {lead.least:.0e}"
            if lead.least == lead.most
            else f"at errors from {lead.least:.0e} to {lead.most:.0e}"
        )
        + (f": up to {lead.times:.2g}×" if math.isfinite(lead.times) else ": none of ours gets there")
        for lead in found
    )


def by_scene(runs: list[Run]) -> dict[str, list[Run]]:
    """Scene → its runs."""
    found: dict[str, list[Run]] = {}
    for item in runs:
        found.setdefault(item.scene, []).append(item)
    return found


def default_of(scene: str) -> tuple[str, int]:
    """Method and step [µs] that a scene gets by default."""
    reduced = reduce_scene(case(scene).scene)
    return reduced.method, round(reduced.sub_step * 1e6)


def default_method(name: str) -> str:
    """Method that a scene of config/scenes gets by default."""
    return reduce_scene(load(name)).method


def markdown(runs: list[Run]) -> str:
    """Rows of each scene: the method that it gets by default, in bold, and beside it `impulse` or `partitioned`.

    At the step nearest to that which the scene would get; in the last row how many times faster than each peer the best
    of ours is.
    """
    heads = ["scene", "method", "step", "error", "of an exchange", "overlap", "energy created", *map(title, PEERS)]
    rows = []
    for scene, of_scene in by_scene(runs).items():
        faster = {ratio.peer: ratio for ratio in ratios(of_scene)}
        rows += [_row(item, item.method == default_of(scene)[0]) for item in _shown(scene, of_scene)]
        rows[-1] += [_cell(faster.get(peer), of_scene, peer) for peer in PEERS]
    return as_table(heads, [row + [""] * (len(heads) - len(row)) for row in rows])


def _shown(scene, runs):
    """Runs of the default method, of `impulse` and of `partitioned` at their own steps."""
    chosen = case(scene).scene
    for method in dict.fromkeys(("impulse", default_of(scene)[0], "partitioned")):
        step = round(reduce_scene(chosen, method).sub_step * 1e6)
        if item := nearest(runs, method, step):
            yield item


def _row(item, chosen):
    created = f"{item.created_j:.0e} J" if item.created_j else "0"
    overlap = f"{1e6 * item.penetration_m:.1g} µm" if item.penetration_m > 1e-10 else "0"
    return [
        item.scene,
        f"**{item.method}**" if chosen else item.method,
        f"{item.step_us * 1e-3:g} ms",
        f"{item.error:.1e}",
        f"{_short(100.0 * item.wall)} %",
        overlap,
        created,
    ]


def nearest(runs: list[Run], method: str, step: int) -> Run | None:
    """Run of a method whose step is nearest to this one [µs]."""
    return min(
        (item for item in runs if item.method == method),
        key=lambda item: abs(math.log(item.step_us / step)),
        default=None,
    )


def _cell(ratio, runs, peer):
    if ratio:
        mark = "" if ratio.reached or not ratio.asked else " ✗"
        return f"{_short(ratio.ratio)}× at {ratio.error:.0e}{mark}"
    of_peer = [item for item in runs if item.method == peer]
    if not of_peer:
        return "not run"
    return "cannot" if any(item.status.startswith("cannot") for item in of_peer) else "unstable"


def _short(value):
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def summary(runs: list[Run]) -> list[tuple[str, str, float, float, int, int]]:
    """(class, peer, least ratio, ratio wanted, how many reach it, how many) over the scenes."""
    found = {}
    for of_scene in by_scene(runs).values():
        for ratio in ratios(of_scene):
            found.setdefault((ratio.kind, ratio.peer), []).append(ratio)
    return [
        (kind, peer, min(item.ratio for item in items), WANTED[kind], sum(item.reached for item in items), len(items))
        for (kind, peer), items in found.items()
    ]
