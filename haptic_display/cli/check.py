# SPDX-License-Identifier: Apache-2.0
"""`haptic check FILE...`: says whether files are right before anything moves; --verify measures scenes."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from haptic_device.config import yaml_reader
from haptic_device.config.files import names
from haptic_display.cli.completion import completed_words, shipped
from haptic_display.cli.numbers import number
from haptic_display.cli.progress import INTERRUPTED, progress
from haptic_display.cli.words import next_step, shown_path
from haptic_display.run.config_problems import problems, remark
from haptic_display.run.processes import interruptible
from haptic_sim.reduction.measured import read, write
from haptic_sim.scene.language import load

ALL = "all"
_FILES = "Operating points, device descriptions or scenes (YAML); with --verify scenes, by name too, or `all`."
_VERIFY = "Measure what each method costs on these scenes, and its error."
_OUT = "With --verify: a file with a table, in which its rows are put."
_LATENESS = "Lateness of the machine's writes that gains are judged by; measured for half a second by default."


def _scene(incomplete: str) -> list[str]:
    return shipped("scenes")(incomplete) if "--verify" in completed_words() else []


def check(
    files: Annotated[list[Path], typer.Argument(help=_FILES, autocompletion=_scene)],
    lateness: Annotated[float | None, number("ms", 0.0, 100.0, help=_LATENESS)] = None,
    measured: Annotated[bool, typer.Option("--verify", help=_VERIFY)] = False,
    out: Annotated[Path | None, typer.Option(help=_OUT)] = None,
) -> None:
    """Check configuration files: prints ok or one sentence for each thing that is wrong; exit code 1 if any is.

    Of a scene that is right it says where the error of its method is greater than the scene allows, and of gains that
    are right where this machine is too late for them. With --verify it measures scenes instead: exit code 1 if a method
    that is chosen does not keep its scene's bounds.
    """
    if (lateness if measured else out) is not None:
        raise ValueError("--out is for --verify, and --lateness for all but --verify")
    if measured:
        return verify_scenes([str(file) for file in files], out)
    wrong, late = 0, functools.cache(_late)

    def measure(driver: dict[str, Any]) -> float | None:
        return late(driver["servo.rate"], driver["realtime"]) if lateness is None else lateness * 1e-3

    for path in files:
        sentences = problems(path, measure)
        wrong += len(sentences)
        if not sentences:
            said = remark(path, measure)
            sentences = [f"ok; but {said}" if said else "ok"]
        typer.echo("\n".join(f"{path}: {sentence}" for sentence in sentences))
    if not wrong:
        next_step(_run(files[0]))
    raise typer.Exit(1 if wrong else 0)


def _run(path: Path) -> str:
    """The command that runs a right file."""
    document = yaml_reader.load(path)
    kind = "--device" if "axes" in document else "--scene" if "tool" in document or "bodies" in document else "--params"
    return f"haptic demo --view {kind} {shown_path(path)}"


def _late(rate: float, realtime: str) -> float | None:
    from haptic_display.run.lateness import write_delay  # loads the compiler, which no other check needs

    return write_delay(rate, realtime)


def verify_scenes(given: list[str], out: Path | None, measure: Callable | None = None) -> None:
    """Prints a table of these scenes, or of all that are shipped; the rows take the place of older ones in `out`.

    Exit code 1: a method that is chosen does not keep its scene's bounds. 130: interrupted; what was measured is shown
    and kept.
    """
    from haptic_sim.lockstep.verify import BEYOND, assessment_of, case_of, markdown, verify

    if out and not out.parent.is_dir():
        raise ValueError(f"--out is {out}, but there is no folder {out.parent}")
    scenes = {name: load(name) for name in (names("scenes") if ALL in given else given)}
    known, found = read(out) if out else [], []
    whole = _measure(scenes, found, measure or (lambda name: verify(case_of(name))))
    assessments = [assessment_of(scenes[name], row) for name, row in found]
    rows = [row for _, row in found]
    typer.echo(markdown(rows, assessments))
    if out:
        new = {row.scene for row in rows}
        write(sorted([row for row in known if row.scene not in new] + rows, key=lambda row: row.scene), out)
    if not whole or BEYOND in assessments:
        raise typer.Exit(1 if whole else INTERRUPTED)


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
        typer.echo(f"haptic check: interrupted; {done} of {len(scenes)} scenes are measured", err=True)
        return False
    return True
