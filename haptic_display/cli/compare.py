# SPDX-License-Identifier: Apache-2.0
"""`haptic compare`: one recorded hand at several operating points, in a table."""

import time
from pathlib import Path
from typing import Annotated

import typer

from haptic_display.cli.completion import shipped
from haptic_display.cli.numbers import number
from haptic_display.cli.replay import As
from haptic_display.cli.words import next_step, shown_path

_POINTS = "Operating points: names in config or YAML files."


def compare(
    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file with the hand's motion.")],
    points: Annotated[list[str], typer.Argument(help=_POINTS, autocompletion=shipped(""))],
    as_: Annotated[As, typer.Option("--as", help="The hand's target, or the device's own position.")] = As.target,
    delay: Annotated[float, number("s", 0.0, 10.0, help="Delay of the exchange there and back [s].")] = 0.0,
    out: Annotated[Path | None, typer.Option(help="New folder for the bags and the report.")] = None,
    namespace: Annotated[str | None, typer.Option(help="Where the bag holds several devices.")] = None,
) -> None:
    """Play the same motion at each operating point, in lock-step; a table, a bag of each, and a report of all."""
    from haptic_display.cli.tables import print_comparison, print_notes
    from haptic_display.run.report.page import MOST, write_report
    from haptic_display.run.report.reading import read_run
    from haptic_sim.lockstep import rerun
    from haptic_sim.lockstep.lockstep import Network

    if len(points) > MOST:
        raise ValueError(f"{len(points)} operating points are given; at most {MOST} stand side by side")
    out = out or Path("haptic_bags") / time.strftime("compare-%Y%m%d-%H%M%S")
    given = {f"{number}-{Path(point).stem}": rerun.given_at(point) for number, point in enumerate(points, 1)}
    recording = rerun.recorded(bag, namespace)
    print_notes(bag, recording.notes)
    hand = rerun.hand_of(recording, as_ is As.device)
    for name, changes in given.items():
        rerun.replay(hand, rerun.recorded_point(recording, changes), Network(delay), out / name)
    runs = [read_run(out / name) for name in given]
    print_comparison({run.name: run for run in runs})
    page = write_report(runs, out / "report")
    typer.echo(page)
    next_step(f"open {shown_path(page)}")
