# SPDX-License-Identifier: Apache-2.0
"""`haptic report`: what a recording shows, as one page that opens anywhere."""

import time
from pathlib import Path
from typing import Annotated

import typer


def report(
    bags: Annotated[list[Path], typer.Argument(help="Bag folders or .mcap files, shown side by side.")],
    out: Annotated[Path | None, typer.Option(help="Folder for page and figures [haptic_reports/TIME].")] = None,
    namespace: Annotated[str | None, typer.Option(help="Where a bag holds several devices.")] = None,
) -> None:
    """Write report.html (self-contained, offline) and its figures. What is wrong with a bag is said in it."""
    from haptic_device.analysis.page import write_report
    from haptic_device.analysis.run import read_run

    out = out or Path("haptic_reports") / time.strftime("%Y%m%d-%H%M%S")
    runs = [read_run(bag, namespace) for bag in bags]
    page = write_report(runs, out)
    for run in runs:
        for note in run.notes:
            typer.echo(f"{run.name}: {note}", err=True)
    typer.echo(page)
