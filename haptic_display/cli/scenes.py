# SPDX-License-Identifier: Apache-2.0
"""`haptic scenes`: what scenes there are, their pictures, and what their simulation takes."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from haptic_device.config.files import names
from haptic_device.digits import amount
from haptic_display.cli.completion import shipped
from haptic_display.cli.progress import INTERRUPTED, progress
from haptic_display.cli.words import console, next_step, print_sentence, shown_path
from haptic_display.run.processes import interruptible
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.explain import explain
from haptic_sim.reduction.measured import read, said, write
from haptic_sim.reduction.promise import kept_rows
from haptic_sim.scene.language import load

ALL = "all"
_DRAW = "Write a picture of this scene (a name or a YAML file)."
_EXPLAIN = "Say what has to be modelled of this scene, by which method."
_VERIFY = "Measure what each method costs on this scene, and its error, or on `all` ones."
_OUT = "The picture's file [NAME.png], or a file with a table in which --verify puts its rows."


def scenes(
    draw: Annotated[str | None, typer.Option(help=_DRAW, autocompletion=shipped("scenes"))] = None,
    out: Annotated[Path | None, typer.Option(help=_OUT)] = None,
    explained: Annotated[str | None, typer.Option("--explain", help=_EXPLAIN, autocompletion=shipped("scenes"))] = None,
    measured: Annotated[str | None, typer.Option("--verify", help=_VERIFY, autocompletion=shipped("scenes"))] = None,
    gallery: Annotated[Path | None, typer.Option(help="Write a page with all scenes into this folder.")] = None,
):
    """List the scenes; draw one; say what the simulation of one takes; measure what each method makes of it."""
    if out and bool(draw) == bool(measured):
        raise ValueError("--out names the picture of --draw or the table of --verify; give one of them with it")
    if draw:
        _draw(draw, out)
    if explained:
        _explain(explained)
    if gallery:
        from haptic_display.page.film.gallery import write_gallery

        with progress(len(names("scenes"))) as show:
            write_gallery(gallery, show)
        typer.echo(gallery / "README.md")
        next_step(f"open {shown_path(gallery / 'README.md')}")
    if measured:
        verify_scenes(measured, out)
    if not (draw or explained or gallery or measured):
        _list()


def _list():
    table = Table(title="Scenes")
    for column in ("name", "what", "DOF", "method", "sub-step"):
        right = "right" if column in ("DOF", "sub-step") else "left"
        table.add_column(column, justify=right, no_wrap=column != "what")
    for name in names("scenes"):
        scene = load(name)
        reduced = reduce_scene(scene)
        table.add_row(name, scene.description, str(reduced.needs.dof), reduced.method, amount(reduced.sub_step, "s"))
    console().print(table)
    next_step("haptic scenes --explain NAME, or haptic demo --view --scene NAME")


def _draw(name, out):
    from haptic_sim.scene.draw import save

    scene = load(name)
    path = out or Path(f"{Path(name).stem}.png")
    save(scene, path)
    typer.echo(path)
    next_step(f"open {shown_path(path)}, or haptic demo --view --scene {shown_path(name)}")


def _explain(name):
    scene = load(name)
    typer.echo(f"{scene.name}: {scene.description}")
    for question, answer in (*explain(reduce_scene(scene)), *_candidates(scene, name)):
        print_sentence(f"  {question:<12} {answer}", 15)
    next_step(f"haptic demo --view --scene {shown_path(name)}")


def _candidates(scene, name):
    """(method, cost and error) of those that could have been chosen; one line for a scene not in the table."""
    if rows := kept_rows(scene):
        return [(row.method, said(row)) for row in rows]
    return [("candidates", f"not measured; haptic scenes --verify {name} measures them")]


def verify_scenes(scene: str, out: Path | None, measure: Callable | None = None) -> None:
    """Prints a table of this scene, or of all that are shipped; the rows take the place of older ones in `out`.

    Exit code 1: a method that is chosen does not keep its scene's bounds. 130: interrupted; what was measured is shown
    and kept.
    """
    from haptic_sim.lockstep.verify import BEYOND, assessment_of, case_of, markdown, verify

    if out and not out.parent.is_dir():
        raise ValueError(f"--out is {out}, but there is no folder {out.parent}")
    scenes = {name: load(name) for name in (names("scenes") if scene == ALL else [scene])}
    known, found = read(out) if out else [], []
    whole = _measure(scenes, found, measure or (lambda name: verify(case_of(name))))
    assessments = [assessment_of(scenes[name], row) for name, row in found]
    rows = [row for _, row in found]
    typer.echo(markdown(rows, assessments))
    if out:
        new = {row.scene for row in rows}
        write(sorted([row for row in known if row.scene not in new] + rows, key=lambda row: row.scene), out)
    if not whole:
        raise typer.Exit(INTERRUPTED)
    if BEYOND in assessments:
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
