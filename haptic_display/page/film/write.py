# SPDX-License-Identifier: Apache-2.0
"""Writes the film of one run, or of two on top of each other."""

from collections.abc import Callable
from pathlib import Path

from haptic_device.os_errors import naming
from haptic_display.page.film.gif import write_gif
from haptic_display.page.film.page import page_of
from haptic_display.page.film.reading import film_of
from haptic_display.run.report.run import Run


def write_film(runs: list[Run], folder: Path, show: Callable[[int, str], None] = lambda done, what: None) -> list[Path]:
    """Writes film.html of one or two runs, and film.gif of the first, into a folder; returns their paths.

    Raises ValueError for a run with nothing to show, and OSError if a file cannot be written.

    Args:
        runs: from `read_run`.
        folder: created if it does not exist.
        show: called during the work with the number of runs that are read and the next step.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_display.run.report.reading import read_run
        >>> from haptic_display.page.film.write import write_film
        >>> [path.name for path in write_film([read_run("run/bag")], Path("film"))]
        ['film.html', 'film.gif']
    """
    films = []
    for number, run in enumerate(runs):
        show(number, f"reading {run.name}")
        films.append(film_of(run))
    page, picture = folder / "film.html", folder / "film.gif"
    folder.mkdir(parents=True, exist_ok=True)
    show(len(runs), "drawing the film")
    text = page_of(films)
    with naming(page):
        page.write_text(text, encoding="utf-8")
    write_gif(films[0], picture)
    return [page, picture]
