# SPDX-License-Identifier: Apache-2.0
"""The report of one or more runs: one HTML file that needs nothing else, and its figures as PNG files.

On top the verdict, then the figures, then all numbers in tables to be opened.
"""

import base64
from collections.abc import Iterable, Sequence
from html import escape as _text
from pathlib import Path

from haptic_device.digits import UNKNOWN
from haptic_device.os_errors import naming
from haptic_device.theory.palette import RUNS
from haptic_display.run.report.figures import FIGURES, Figure, Special, draw_figure
from haptic_display.run.report.quantities import sections
from haptic_display.run.report.run import Run
from haptic_display.run.report.style import LEVELS, STYLE
from haptic_display.run.report.verdict import verdict

MOST = len(RUNS)  # runs side by side
CAPTIONS = {
    "positions": "Where handle and tool went.",
    "distances": "How far the tool was from the handle.",
    "forces": "Force on the handle, and the coupling's part of it.",
    "angles": "Angle of handle and tool, counter-clockwise.",
    "path": "The way in the plane, to scale.",
    "contacts": "From when to when something was touched, and the strongest force on the hand meanwhile.",
    "energies": "Energy through each port since the first tick; what operator or tool is given is positive.",
    "margin": "How much of the device's damping b the gains leave over; below zero the display is not passive.",
    "lateness": "How late the servo woke, and how long it worked.",
    "age": "Age of the tool sample in use.",
    "spectrum": "Spectrum of the force on the handle; an oscillation is named.",
    "impedance": "Stiffness and damping that the display added, 95 % sure; dotted: as set.",
}


def write_report(runs: list[Run], folder: Path, left_out: Sequence[str] = ()) -> Path:
    """Writes report.html and its figures into a folder; returns the path of the page.

    The page needs no network and no other file. Raises ValueError for too many runs, OSError if it cannot be written.

    Args:
        runs: from `read_run`.
        folder: created if it does not exist.
        left_out: sentences about recordings that are not shown.

    Examples:
        >>> from pathlib import Path
        >>> from haptic_display.run.report.page import write_report
        >>> from haptic_display.run.report.reading import read_run
        >>> write_report([read_run("run/bag")], Path("report")).name
        'report.html'
    """
    if len(runs) > MOST:
        raise ValueError(f"{len(runs)} bags are given; at most {MOST} stand side by side")
    folder.mkdir(parents=True, exist_ok=True)
    figures = [_figure(figure, runs, folder / f"{figure.name}.png") for figure in FIGURES]
    parts = [_head(runs), _notes(runs, left_out), _contents(), "</header><main>", *figures]
    parts += ['<h2 id="tables">All numbers</h2>', _tables(runs), "</main></body></html>\n"]
    page = folder / "report.html"
    with naming(page):
        page.write_text("\n".join(parts), encoding="utf-8")
    return page


def _head(runs: list[Run]) -> str:
    names = ", ".join(run.name for run in runs)
    style = f"<style>\n{STYLE}</style>"
    view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    title = f"<title>{_text(names)}</title>"
    head = f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">{view}{title}{style}</head>'
    told = [_what_ran(run) for run in runs]
    same = [entry for entry in told[0] if len(runs) > 1 and all(entry in others for others in told)]
    verdicts = [
        _verdict(run, number, [entry for entry in told[number] if entry not in same], len(runs) > 1)
        for number, run in enumerate(runs)
    ]
    alike = [f'<p class="quiet">All: {_entries(same)}</p>'] if same else []
    return "\n".join([f"{head}<body><header><h1>Report: {_text(names)}</h1>", *verdicts, *alike])


def _verdict(run: Run, number: int, ran: list[str], several: bool) -> str:
    """The box of one run: its key in the figures where there are several, how it ended, what ran."""
    found = verdict(run)
    key = f"{_swatch(number)} <b>{_text(run.name)}</b>: " if several else ""
    said = f"<p>{key}<strong>{LEVELS[found.level][0]}</strong> {_text(found.ending)} {_text(found.rest)}</p>"
    return f'<section class="verdict {found.level}">{said}<p class="quiet">{_entries(ran)}</p></section>'


def _entries(entries: list[str]) -> str:
    """In one line, which breaks between them."""
    return " · ".join(f"<span>{_text(entry)}</span>" for entry in entries)


def _what_ran(run: Run) -> list[str]:
    """Date, length, scene, methods and conditions, an entry each."""
    begun = f"{run.begun:%-d %B %Y, %H:%M %Z}" if run.begun else "replayed in lock-step"
    parts = [begun, f"{run.length:.1f} s", f"scene {run.scene or 'not recorded'}"]
    if method := run.recording.last_values("haptic_simulation").get("method"):
        parts.append(f"method {method}")
    return parts + [f"{name} {value}" for name, value in run.conditions.items()]


def _swatch(number: int) -> str:
    look = RUNS[number]
    dashes = " ".join(map(str, look.dashes[1])) or "none"
    line = f'<line x1="2" y1="7" x2="42" y2="7" stroke="{look.colour}" stroke-width="3" stroke-dasharray="{dashes}"/>'
    return f'<svg width="44" height="14" aria-hidden="true">{line}</svg>'


def _notes(runs: list[Run], left_out: Sequence[str]) -> str:
    said = [*left_out, *(f"{run.name}: {note}" for run in runs for note in run.notes)]
    notes = "".join(f"<p>{_text(sentence)}</p>" for sentence in said)
    return f'<div class="notes">{notes}</div>' if notes else ""


def _contents() -> str:
    places: Iterable[tuple[str, str]] = [(figure.name, figure.title) for figure in FIGURES] + [("tables", "Numbers")]
    links = "".join(f'<li><a href="#{name}">{_text(title)}</a></li>' for name, title in places)
    return f'<nav aria-label="Contents"><ul>{links}</ul></nav>'


def _figure(figure: Figure | Special, runs: list[Run], picture: Path) -> str:
    picture.unlink(missing_ok=True)
    said = draw_figure(figure, runs, picture)
    title, caption, image = _text(figure.title), _text(CAPTIONS[figure.name]), ""
    if picture.exists():
        data = base64.b64encode(picture.read_bytes()).decode()
        image = f'<img alt="{title}: {caption}" src="data:image/png;base64,{data}">'
    reasons = "".join(f"<p>{_text(sentence)}</p>" for sentence in said)
    head = f'<figure id="{figure.name}"><h2>{title}</h2><figcaption>{caption}</figcaption>'
    return f"{head}{image}{reasons}</figure>"


def _tables(runs: list[Run]) -> str:
    columns = [sections(run) for run in runs]
    names = "".join(f'<th scope="col">{_text(run.name)}</th>' for run in runs)
    head = f"<thead><tr><td></td>{names}</tr></thead>" if len(runs) > 1 else ""
    parts = []
    for title in columns[0]:
        lines = list(dict.fromkeys(name for column in columns for name in column[title]))
        rows = "".join(_row(name, [column[title].get(name, UNKNOWN) for column in columns]) for name in lines)
        if rows:
            table = f"<table>{head}<tbody>{rows}</tbody></table>"
            parts.append(f"<details><summary><h3>{_text(title)}</h3></summary>{table}</details>")
    return "\n".join(parts)


def _row(name: str, values: list[str]) -> str:
    cells = "".join(f"<td>{_text(value)}</td>" for value in values)
    return f'<tr><th scope="row">{_text(name)}</th>{cells}</tr>'
