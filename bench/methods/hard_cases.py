# SPDX-License-Identifier: Apache-2.0
"""Hard cases: which method survives which scene, with the plane turned and the phase of the contact shifted.

Every world gets the scene's own sub-step. It fails by one letter each: N not finite, T through a wall, P overlap beyond
0.1 mm, E energy created beyond 1 % of the largest energy; e, no failure of a peer, is energy beyond rounding.
"""

import json
import math
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from bench.jobs import Kept, listed, plain, sweep, usable, write_csv
from bench.jobs import markdown as as_table
from bench.methods.table import default_method
from bench.methods.world import Impossible, make, title
from bench.reference.trial import jump, turned_scene
from haptic_display.cli.progress import INTERRUPTED
from haptic_sim.lockstep.error_metrics import Case
from haptic_sim.lockstep.rollout import GAINS, hand, overlap_watch, rollout, way
from haptic_sim.lockstep.verify import CREATED, LEAST, OVERLAP
from haptic_sim.protocol import Coupling
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.geometry import framed
from haptic_sim.scene.language import load
from haptic_sim.scene.shapes import TOOL

HEAD = (
    "# Hard cases\n\n`python -m bench hard_cases` writes this page. Each scene is turned to several positions, and a "
    "cell shows the worst result. The column *default* names the method that the scene gets. The text below the table "
    "explains the letters.\n\n"
)
LEGEND = (
    "✓ survives · N a value is not finite · T a body passes through a wall · P overlap of more than 0.1 mm · "
    "E creates more than 1 % of the largest energy in the run · (e) creates energy, more than rounding errors · "
    "– the method cannot model the scene"
)
MANY, FEW = 6, 2
ROUNDING, JUMP = 1e-7, 0.02  # share of the largest energy about; s
_STEP = 0.25e-3
STIFF = Coupling(100.0 * 0.1 / _STEP**2, 0.0, 100.0 * 6.7e-6 / _STEP**2, 0.0)
"""100 m/h², undamped."""
OWN_GAINS = {"stiff_coupling": STIFF}
SECONDS = {
    "collinear_1e3": 0.06,
    "collinear_1e6": 0.06,
    "corner_overlap": 0.6,
    "falling_rod": 0.1,
    "four_bar_singular": 2.0,
    "handle_jump": 0.15,
    "heavy_on_light_1e3": 0.7,
    "heavy_on_light_1e6": 0.7,
    "light_tool": 0.6,
    "painleve_rod": 0.3,
    "peg_jammed": 3.6,
    "peg_tight": 3.6,
    "peg_wedged": 3.6,
    "slider_stop": 0.2,
    "spinning_wrench": 7.0,
    "stack_20": 0.12,
    "stiff_coupling": 0.6,
    "thin_plate": 0.02,
    "zeno_ball": 1.5,
}
NAMES = tuple(SECONDS)
SIDES = {  # where a body must stay: (body, axis, least coordinate)
    "thin_plate": ("shot", (-1.0, 0.0), -0.0451),
    "handle_jump": (TOOL, (1.0, 0.0), 0.0),
    "stiff_coupling": (TOOL, (1.0, 0.0), 0.0),
    "light_tool": (TOOL, (1.0, 0.0), 0.0),
    "corner_overlap": (TOOL, (1.0, 0.0), 0.0),
}


class Verdict(NamedTuple):
    """The worst of a sweep: letters of what failed, deepest overlap [m], energy created over the largest energy."""

    scene: str
    world: str
    letters: str
    overlap_m: float
    created: float
    tried: int
    """Positions of the sweep."""

    @property
    def survives(self) -> bool:
        """Whether nothing failed anywhere."""
        return not set(self.letters) & set("NTPE") and not self.letters.startswith("cannot")


def case(name: str, look: int) -> Case:
    """A hard scene as it stands, as a case that is looked at every so many ns."""
    scene = load(name)
    lead = jump(scene, 0.0, JUMP) if name == "handle_jump" else None
    return Case(name, "hard", SECONDS[name], scene, OWN_GAINS.get(name, GAINS), True, look, lead)


def positions(count: int) -> list[tuple[float, float]]:
    """(angle of the plane [rad], phase in sub-steps); the first is the scene as it stands."""
    return [(2.0 * math.pi * k * 0.381966 % (2.0 * math.pi), 0.37 * k % 1.0) for k in range(count)]


def verdict(name: str, world: str, count: int) -> Verdict:
    """The worst of `count` positions of the scene called `name`."""
    try:
        found = [_attempt(name, world, *position) for position in positions(count)]
    except Impossible as reason:
        return Verdict(name, world, f"cannot: {reason}", math.nan, math.nan, 0)
    letters, overlaps, created = zip(*found, strict=True)
    return Verdict(name, world, "".join(sorted(set().union(*letters))), max(overlaps), max(created), count)


def _attempt(name, kind, angle, phase):
    """Letters, deepest overlap, energy created over the largest energy."""
    scene = load(name)
    step = _STEP if name == "stiff_coupling" else reduce_scene(scene).sub_step
    times = np.arange(round(SECONDS[name] * 1e3) + 1) * 1e-3 + phase * step
    path = way(jump(scene, angle, JUMP) if name == "handle_jump" else hand(scene, angle), times)
    if name == "handle_jump":
        path[:, 3:] = 0.0
    scene = turned_scene(scene, angle, phase * step)
    world, gains = make(kind, scene, step), OWN_GAINS.get(name, GAINS)
    world.couple(gains)
    found = rollout(world, path, round(1e-3 / step), overlap=overlap_watch(scene, world.pose), gains=gains)
    if not found.finite:
        return "N", math.inf, math.inf
    share = found.created / max(found.scale, LEAST)
    letters = "E" if share > CREATED else "e" if share > ROUNDING else ""
    letters += "P" if found.overlap > OVERLAP else ""
    letters += "T" if name in SIDES and _passed(world, *SIDES[name], angle) else ""
    return letters, found.overlap, share


def _passed(world, body, axis, least, angle):
    x, y = framed(world.pose(body)[:2], (0.0, 0.0, angle))
    return axis[0] * x + axis[1] * y < least


def main(
    scenes: Annotated[str | None, typer.Option(help="Comma-separated hard scenes [all].")] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods and peers [all].")] = None,
    short: Annotated[bool, typer.Option("--short", help=f"{FEW} positions of each scene instead of {MANY}.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder for hard_cases.csv and hard_cases.md.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Hard scenes, turned and shifted: what stays finite, apart, on its side of walls, and creates no energy."""
    count = FEW if short else MANY
    jobs = {(name, world): (name, world, count) for name in listed(scenes, NAMES, "scene") for world in usable(methods)}
    kept = Kept()
    whole = sweep(verdict, jobs, kept)
    found = list(kept.known.values())
    if out:
        out.mkdir(parents=True, exist_ok=True)
        write_csv(out / "hard_cases.csv", Verdict, found)
        (out / "hard_cases.md").write_text(f"{HEAD}{markdown(found)}\n", encoding="utf-8")
    if as_json:
        typer.echo(json.dumps({"verdicts": [plain(item) | {"survives": item.survives} for item in found]}))
    else:
        typer.echo(markdown(found))
    if not whole:
        raise typer.Exit(INTERRUPTED)


def markdown(found) -> str:
    """Scene by world, and what the letters mean."""
    worlds = list(dict.fromkeys(item.world for item in found))
    cells = {(item.scene, item.world): item for item in found}
    rows = [
        [scene, default_method(scene), *(_cell(cells.get((scene, world))) for world in worlds)]
        for scene in dict.fromkeys(item.scene for item in found)
    ]
    return f"{as_table(['scene', 'default', *map(title, worlds)], rows)}\n\n{LEGEND}"


def _cell(item):
    if item is None:
        return ""
    if item.letters.startswith("cannot"):
        return "–"
    failed = "".join(letter for letter in item.letters if letter in "NTPE")
    return failed or ("✓ (e)" if "e" in item.letters else "✓")
