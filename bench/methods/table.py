# SPDX-License-Identifier: Apache-2.0
"""Runs as one Markdown table."""

import math

from bench.methods.compare import WANTED, pareto, ratios
from bench.methods.measure import Run
from bench.methods.world import OURS, PEERS, title
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load
from reference.case import case


def scenes_of(runs: list[Run]) -> list[str]:
    """Names in the order of the runs."""
    return list(dict.fromkeys(item.scene for item in runs))


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
    rows = [heads, ["---"] * len(heads)]
    for scene in scenes_of(runs):
        of_scene = [item for item in runs if item.scene == scene]
        faster = {ratio.peer: ratio for ratio in ratios(of_scene)}
        rows += [_row(item, item.method == default_of(scene)[0]) for item in _shown(scene, of_scene)]
        rows[-1] += [_cell(faster.get(peer), of_scene, peer) for peer in PEERS]
    return "\n".join(f"| {' | '.join(row + [''] * (len(heads) - len(row)))} |" for row in rows)


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


def costs(runs: list[Run]) -> str:
    """Wall time of one step [µs], a row a scene: the least over the steps tried."""
    methods = [name for name in (*OURS, *PEERS) if any(item.method == name for item in runs)]
    rows = [["scene", *map(title, methods)], ["---"] * (1 + len(methods))]
    for scene in scenes_of(runs):
        spent = {
            name: min(
                (
                    item.wall * item.step_us
                    for item in runs
                    if (item.scene, item.method) == (scene, name) and item.counts
                ),
                default=None,
            )
            for name in methods
        }
        rows.append([scene, *("" if value is None else f"{value:.3g}" for value in spent.values())])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


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
    for scene in scenes_of(runs):
        of_scene = [item for item in runs if item.scene == scene]
        for ratio in ratios(of_scene):
            found.setdefault((ratio.kind, ratio.peer), []).append(ratio)
    return [
        (kind, peer, min(item.ratio for item in items), WANTED[kind], sum(item.reached for item in items), len(items))
        for (kind, peer), items in found.items()
    ]


def fronts(runs: list[Run]) -> dict[str, list[Run]]:
    """Method or peer → its runs that no other of its own beats, of one scene."""
    return {
        name: pareto([item for item in runs if item.method == name])
        for name in dict.fromkeys(item.method for item in runs)
    }
