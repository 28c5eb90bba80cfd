# SPDX-License-Identifier: Apache-2.0
"""`haptic scenes`: what scenes there are, their pictures, and what their simulation takes."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from haptic_device.config_files import names
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.explain import explain
from haptic_sim.reduction.measured import of_scene, said
from haptic_sim.scene import load

_OUT = "The picture's file [NAME.png], or a file with a table in which --verify puts its rows."


def scenes(
    draw: Annotated[str | None, typer.Option(help="Write a picture of this scene (a name or a YAML file).")] = None,
    out: Annotated[Path | None, typer.Option(help=_OUT)] = None,
    explained: Annotated[
        str | None, typer.Option("--explain", help="Say what has to be modelled of this scene, by which method.")
    ] = None,
    verify: Annotated[
        str | None, typer.Option(help="Measure what each method costs and errs on this scene, or on `all` ones.")
    ] = None,
    gallery: Annotated[Path | None, typer.Option(help="Write a page with all scenes into this folder.")] = None,
):
    """List the scenes; draw one; say what the simulation of one takes; measure what each method makes of it."""
    if out and bool(draw) == bool(verify):
        raise ValueError("--out names the picture of --draw or the table of --verify; give one of them with it")
    if draw:
        _draw(draw, out)
    if explained:
        _explain(explained)
    if gallery:
        from haptic_sim.cli.gallery import write

        write(gallery)
        typer.echo(gallery / "README.md")
    if verify:
        from haptic_sim.cli.scenes_verify import run

        run(verify, out)
    if not (draw or explained or gallery or verify):
        _list()


def _list():
    table = Table(title="scenes; haptic scenes --draw NAME, --explain NAME, haptic demo --scene NAME")
    for column in ("name", "what", "freedoms", "method", "sub-step"):
        table.add_column(column, justify="right" if column in ("freedoms", "sub-step") else "left")
    for name in names("scenes"):
        scene = load(name)
        compiled = reduce_scene(scene)
        table.add_row(
            name, scene.description, str(compiled.needs.freedoms), compiled.method, f"{compiled.sub_step * 1e3:g} ms"
        )
    Console(width=None if Console().is_terminal else 120).print(table)


def _draw(name, out):
    from haptic_sim.draw import save

    scene = load(name)
    path = out or Path(f"{scene.name}.png")
    save(scene, path)
    typer.echo(path)


def _explain(name):
    scene = load(name)
    typer.echo(f"{scene.name}: {scene.description}")
    for question, answer in (*explain(reduce_scene(scene)), *_candidates(scene, name)):
        typer.echo(f"  {question:<12} {answer}")


def _candidates(scene, name):
    """(method, what it costs and errs) of those that could have been chosen; one line for a scene not in the table."""
    if scene.name in names("scenes") and scene == load(scene.name) and (rows := of_scene(scene.name)):
        return [(row.method, said(row)) for row in rows]
    return [("candidates", f"not measured; haptic scenes --verify {name} measures them")]
