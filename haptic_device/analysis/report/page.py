# SPDX-License-Identifier: Apache-2.0
"""The report of one or more runs side by side: one HTML file that needs nothing else, and its figures as PNG files.

Of one run also a single picture of the figures that tell most.
"""

import base64
import html
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib
from matplotlib.axes import Axes

from haptic_device.analysis.report import panel
from haptic_device.analysis.report.run import Run
from haptic_device.analysis.report.table import MISSING, sections
from haptic_device.os_errors import naming

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402  (the backend is chosen first)

MOST = 6  # runs side by side
DPI = 130
_STYLE = """
body { font: 15px/1.4 sans-serif; color: #111; background: #fff; max-width: 1200px; margin: 1.5em auto;
padding: 0 1em }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin-top: 1.6em; border-bottom: 1px solid #999 }
table { border-collapse: collapse; width: 100%; table-layout: fixed }
td, th { text-align: left; vertical-align: top; padding: .15em .6em .15em 0; border-bottom: 1px solid #ddd }
td { overflow-wrap: anywhere } th { font-weight: normal; color: #444; width: 22% }
img { max-width: 100% } figure { margin: 0 0 1.2em; break-inside: avoid } figcaption { color: #444 }
.notes { border: 2px solid #D55E00; padding: .3em 1em }
@media print { body { font-size: 10pt; max-width: none; margin: 0 } h2 { break-after: avoid } }
"""


class Figure(NamedTuple):
    """One figure: its file's name, its caption, what it draws, its height [inch], panels for each run."""

    name: str
    caption: str
    draw: Callable[..., None]
    height: float = 3.0
    wide: int = 1


FIGURES = (
    Figure("positions", "Where handle and tool went.", panel.positions),
    Figure("distances", "How far the tool was from the handle: what the coupling was stretched.", panel.distances, 2.2),
    Figure("angles", "Angle of handle and tool.", panel.angles, 2.2),
    Figure("path", "The same in the plane, to scale.", panel.path, 4.0),
    Figure("forces", "Force on the handle; the coupling's part of it dashed. Grey: in contact.", panel.forces),
    Figure("contacts", "Contacts: from when to when, and the strongest on the hand.", panel.contact_events, 1.8),
    Figure("energies", "Energy through each port; what operator or tool is given is positive.", panel.energies),
    Figure("margin", "Passivity margin over time.", panel.margins, 2.2),
    Figure("lateness", "How late the servo woke, and how long it worked.", panel.lateness, 2.5),
    Figure("age", "Age of the tool sample in use.", panel.ages, 2.2),
    Figure("spectrum", "Spectrum of the force on the handle; an oscillation is named.", panel.spectrum),
    Figure(
        "impedance", "Stiffness and damping that the display added, 95 % sure; dotted: set.", panel.impedance, 2.2, 2
    ),
)

TELLING = ("positions", "angles", "forces", "energies", "lateness")  # of the single picture


def draw_picture(run: Run, picture: Path) -> None:
    """Writes the picture (PNG), headed by the run's name and by gains, period, damping and exchange method."""
    figures = [figure for figure in FIGURES if figure.name in TELLING]
    heights = [figure.height for figure in figures]
    shown, grid = pyplot.subplots(len(figures), 1, figsize=(9, 14), layout="constrained", height_ratios=heights)
    try:
        shown.suptitle(_heading(run, 110), fontsize=10)
        for figure, axes in zip(figures, grid, strict=True):
            _try(figure, [axes], run)
        with naming(picture):
            shown.savefig(picture, dpi=110)
    finally:
        pyplot.close(shown)


def write_report(runs: list[Run], folder: Path, left_out: Sequence[str] = ()) -> Path:
    """Writes report.html and the figures into the folder; the path of the page. Raises ValueError for too many runs.

    left_out: sentences about recordings that are not shown.
    """
    if len(runs) > MOST:
        raise ValueError(f"{len(runs)} bags are given; at most {MOST} stand side by side")
    folder.mkdir(parents=True, exist_ok=True)
    parts = [_head(runs, left_out), _table(runs), "<h2>Figures</h2>"]
    for figure in FIGURES:
        picture = folder / f"{figure.name}.png"
        _draw(figure, runs, picture)
        parts.append(_figure(figure, picture))
    page = folder / "report.html"
    with naming(page):
        page.write_text("\n".join([*parts, "</body></html>\n"]), encoding="utf-8")
    return page


def _draw(figure: Figure, runs: list[Run], picture: Path) -> None:
    width = 9.0 if len(runs) == 1 else 5.2 * len(runs)
    shown, grid = pyplot.subplots(
        1, len(runs) * figure.wide, figsize=(width, figure.height + 0.5), layout="constrained", squeeze=False
    )
    try:
        for number, run in enumerate(runs):
            part = list(grid[0, number * figure.wide : (number + 1) * figure.wide])
            part[0].set_title(_heading(run, 72), fontsize=8, loc="left")
            _try(figure, part, run)
        with naming(picture):
            shown.savefig(picture, dpi=DPI)
    finally:
        pyplot.close(shown)


def _heading(run: Run, width: int) -> str:
    """Name and conditions, in lines of so many letters."""
    labels = ", ".join(f"{name} = {value}".replace(" ", "\u00a0") for name, value in run.conditions.items())
    return "\n".join([run.name, *textwrap.wrap(labels, width)])


def _try(figure: Figure, part: Sequence[Axes], run: Run) -> None:
    try:
        figure.draw(part if figure.wide > 1 else part[0], run)
    except (ValueError, IndexError, FloatingPointError) as error:
        part[0].text(0.5, 0.5, f"not shown: {error}", ha="center", va="center", wrap=True, transform=part[0].transAxes)
        for axes in part:
            axes.set_axis_off()


def _head(runs: list[Run], left_out: Sequence[str]) -> str:
    names = ", ".join(html.escape(run.name) for run in runs)
    said = [*left_out, *(f"{run.name}: {note}" for run in runs for note in run.notes)]
    notes = "".join(f"<p>{html.escape(sentence)}</p>" for sentence in said)
    warning = f'<div class="notes">{notes}</div>' if notes else ""
    head = f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{names}</title>'
    return f"{head}<style>{_STYLE}</style></head><body><h1>Haptic display: {names}</h1>{warning}"


def _table(runs: list[Run]) -> str:
    columns = [sections(run) for run in runs]
    parts = []
    for title in columns[0]:
        names = list(dict.fromkeys(name for column in columns for name in column[title]))
        rows = "".join(_row(name, [column[title].get(name, MISSING) for column in columns]) for name in names)
        if rows:
            parts.append(f"<h2>{html.escape(title)}</h2><table>{rows}</table>")
    return "\n".join(parts)


def _row(name: str, values: list[str]) -> str:
    cells = "".join(f"<td>{html.escape(value)}</td>" for value in values)
    return f"<tr><th>{html.escape(name)}</th>{cells}</tr>"


def _figure(figure: Figure, picture: Path) -> str:
    data = base64.b64encode(picture.read_bytes()).decode()
    caption = html.escape(figure.caption)
    image = f'<img alt="{caption}" src="data:image/png;base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
