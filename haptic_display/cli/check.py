# SPDX-License-Identifier: Apache-2.0
"""`haptic check FILE...`: says whether configuration files are right, before anything moves."""

import functools
from pathlib import Path
from typing import Annotated, Any

import typer

from haptic_device.config import yaml_reader
from haptic_display.cli.numbers import number
from haptic_display.cli.words import next_step, shown_path
from haptic_display.run.config_problems import problems, remark

_LATENESS = "Lateness of the machine's writes that gains are judged by; measured for half a second by default."


def check(
    files: Annotated[list[Path], typer.Argument(help="Operating points, device descriptions or scenes (YAML).")],
    lateness: Annotated[float | None, number("--lateness", "ms", 0.0, 100.0, help=_LATENESS)] = None,
) -> None:
    """Check configuration files: prints ok or one sentence for each thing that is wrong; exit code 1 if any is.

    Of a scene that is right it says where the error of its method is greater than the scene allows, and of gains that
    are right where this machine is too late for them.
    """
    wrong, measured = 0, functools.cache(_measured)

    def measure(driver: dict[str, Any]) -> float | None:
        return measured(driver["servo.rate"], driver["realtime"]) if lateness is None else lateness * 1e-3

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


def _measured(rate: float, realtime: str) -> float | None:
    from haptic_display.run.lateness import write_delay  # loads the compiler, which no other check needs

    return write_delay(rate, realtime)
