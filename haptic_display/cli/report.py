# SPDX-License-Identifier: Apache-2.0
"""`haptic report`: what a recording shows, as one page that opens anywhere."""

import time
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.os_errors import in_words
from haptic_display.cli.words import next_step, shown_path

_FILM = "Also film.html, which plays one bag or two, and film.gif."
FILMED = 2  # bags that a film shows


def report(
    bags: Annotated[list[Path], typer.Argument(help="Bag folders or .mcap files; several are shown over each other.")],
    out: Annotated[Path | None, typer.Option(help="Folder for page and figures [haptic_reports/TIME].")] = None,
    namespace: Annotated[str | None, typer.Option(help="Where a bag holds several devices.")] = None,
    film: Annotated[bool, typer.Option("--film", help=_FILM)] = False,
) -> None:
    """Write report.html (self-contained, offline) and its figures. What is wrong with a bag is said in it.

    A bag that cannot be shown is left out, which is said too; the exit code is then 1.
    """
    from haptic_display.cli.tables import print_notes
    from haptic_display.run.report.page import MOST, write_report

    if len(bags) > MOST:
        raise ValueError(f"{len(bags)} bags are given; at most {MOST} stand side by side")
    if film and len(bags) > FILMED:
        raise ValueError(f"{len(bags)} bags are given; --film shows at most {FILMED} on top of each other")
    out = out or Path("haptic_reports") / time.strftime("%Y%m%d-%H%M%S")
    runs, left_out = _read(bags, namespace)
    if not runs:
        raise ValueError("; ".join(left_out))
    said = [f"left out: {reason}" for reason in left_out]
    page = write_report(runs, out, said)
    for run in runs:
        print_notes(run.name, run.notes)
    typer.echo(page)
    if film:
        _film(runs, out)
    for sentence in said:
        typer.echo(sentence, err=True)
    next_step(f"open {shown_path(page)}")
    if said:
        raise typer.Exit(1)


def _film(runs, out: Path) -> None:
    """Writes the film beside the page, and says where."""
    from haptic_display.cli.progress import progress
    from haptic_display.page.film.write import write_film

    with progress(len(runs) + 1) as show:
        written = write_film(runs, out, show)
        show(len(runs) + 1, "done")
    for path in written:
        typer.echo(path)


def _read(bags: list[Path], namespace: str | None):
    """The runs that can be shown, and why the others cannot."""
    from haptic_display.run.report.reading import read_run

    runs, reasons = [], []
    for bag in bags:
        try:
            runs.append(read_run(bag, namespace))
        except (ValueError, OSError) as error:
            said = in_words(error)
            reasons.append(said if str(bag) in said else f"{bag}: {said}")
    return runs, reasons
