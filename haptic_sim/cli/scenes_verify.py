# SPDX-License-Identifier: Apache-2.0
"""`haptic scenes --verify`: what each method that a scene could have costs and errs, measured now."""

import math
from pathlib import Path

import typer

from haptic_device.config_files import names
from haptic_sim.cli.processes import interruptible
from haptic_sim.cli.progress import INTERRUPTED, progress
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.measured import Measured, read, write
from haptic_sim.scene import load
from haptic_sim.verify import case_of, verify, within

ALL = "all"
KEPT, BEYOND, OTHER = "kept", "**beyond**", ""  # bounds of the method that is chosen; another one has none
HEADS = "scene", "method", "step", "error", "reference to", "energy created", "overlap", "exchange", "bounds"


def run(scene: str, out: Path | None, measure=lambda name: verify(case_of(name))) -> None:
    """Prints a table of this scene, or of all that are shipped; the rows take the place of older ones in `out`.

    Exit code 1: a method that is chosen does not keep its scene's bounds. 130: interrupted; what was measured is shown
    and kept.
    """
    if out and not out.parent.is_dir():
        raise ValueError(f"--out is {out}, but there is no folder {out.parent}")
    scenes = {name: load(name) for name in (names("scenes") if scene == ALL else [scene])}
    known, found = read(out) if out else [], []
    whole = _measure(scenes, found, measure)
    verdicts = [_verdict(scenes[name], row) for name, row in found]
    rows = [row for _, row in found]
    typer.echo(markdown(rows, verdicts))
    if out:
        new = {row.scene for row in rows}
        write(sorted([row for row in known if row.scene not in new] + rows, key=lambda row: row.scene), out)
    if not whole:
        raise typer.Exit(INTERRUPTED)
    if BEYOND in verdicts:
        raise typer.Exit(1)


def _measure(scenes, found, measure):
    """Appends (name, row) of each candidate of each scene; whether all were done."""
    try:
        with interruptible(), progress(len(scenes)) as show:
            for done, name in enumerate(scenes):
                show(done, name)
                found += [(name, row) for row in measure(name)]
            show(len(scenes), "done")
    except KeyboardInterrupt:
        done = len({name for name, _ in found})
        typer.echo(f"haptic scenes: interrupted; {done} of {len(scenes)} scenes are measured", err=True)
        return False
    return True


def _verdict(scene, row):
    """Of the method that is chosen, whether it keeps the scene's bounds."""
    if row.method != reduce_scene(scene).method:
        return OTHER
    return KEPT if within(row, scene.error) else BEYOND


def markdown(rows: list[Measured], verdicts: list[str]) -> str:
    """A row a method; the last column says of the one that is chosen whether it keeps the scene's bounds."""
    cells = [HEADS, ["---"] * len(HEADS)]
    for row, said in zip(rows, verdicts, strict=True):
        figures = (
            [row.status] + [""] * 4
            if math.isnan(row.error)
            else [
                f"{row.error:.1e}",
                f"{row.doubt:.0e}",
                f"{row.created:.0e}",
                f"{row.overlap_m * 1e6:.2g} um",
                f"{row.exchange_us:.0f} us",
            ]
        )
        cells.append([row.scene, row.method, f"{row.step_us * 1e-3:g} ms", *figures, said])
    return "\n".join(f"| {' | '.join(cell)} |" for cell in cells)
