# SPDX-License-Identifier: Apache-2.0
"""`haptic scenes`: what scenes there are, their pictures, and what their simulation takes."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column

from haptic_device.config.files import names
from haptic_device.digits import amount
from haptic_display.cli.completion import shipped
from haptic_display.cli.progress import progress
from haptic_display.cli.words import console, next_step, print_sentence, shown_path, table
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.explain import explain
from haptic_sim.reduction.measured import said
from haptic_sim.reduction.promise import kept_rows
from haptic_sim.scene.language import load

_DRAW = "Write a picture of this scene (a name or a YAML file)."
_EXPLAIN = "Say what has to be modelled of this scene, by which method."
_OUT = "The picture's file [NAME.png]."
_WORD, _NUMBER = partial(Column, no_wrap=True), partial(Column, justify="right", no_wrap=True)
COLUMNS = _WORD("name"), "what", _NUMBER("DOF"), _WORD("method"), _NUMBER("sub-step")


def scenes(
    draw: Annotated[str | None, typer.Option(help=_DRAW, autocompletion=shipped("scenes"))] = None,
    out: Annotated[Path | None, typer.Option(help=_OUT)] = None,
    explained: Annotated[str | None, typer.Option("--explain", help=_EXPLAIN, autocompletion=shipped("scenes"))] = None,
    gallery: Annotated[Path | None, typer.Option(help="Write a page with all scenes into this folder.")] = None,
):
    """List the scenes; draw one; say what the simulation of one takes."""
    if out and not draw:
        raise ValueError("--out names the picture of --draw; give it with --draw")
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
    if not (draw or explained or gallery):
        console().print(table(COLUMNS, map(_row, names("scenes")), title="Scenes"))
        next_step("haptic scenes --explain NAME, or haptic demo --view --scene NAME")


def _row(name):
    scene = load(name)
    reduced = reduce_scene(scene)
    return name, scene.description, str(reduced.needs.dof), reduced.method, amount(reduced.sub_step, "s")


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
    return [("candidates", f"not measured; haptic check --verify {name} measures them")]
