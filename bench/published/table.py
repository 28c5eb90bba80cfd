# SPDX-License-Identifier: Apache-2.0
"""Published results beside ours: one table, and a page; exit code 1 where one is out of its tolerance."""

import importlib
import inspect
import textwrap
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from bench.jobs import markdown
from bench.published.source import EXACT, ORDER, SHAPE, Result, Source, agrees, load, missing
from haptic_device.config.files import ConfigError

FOLDER = Path(__file__).parent
HEADS = "source", "what", "published", "ours", "tolerance", "kind", "verdict"
KEPT, LEFT = "kept", "**left**"
_OUT = "File for the page, written only if all results are kept."
MODULES = [importlib.import_module(f"bench.published.{file.stem}") for file in sorted(FOLDER.glob("*.yaml"))]
OURS: dict[str, Callable] = {
    f"{module.__name__.rpartition('.')[2]}.{name}": function
    for module in MODULES
    for name, function in inspect.getmembers(module, inspect.isfunction)
    if function.__module__ == module.__name__ and not name.startswith("_")
}
"""What a YAML file may name under `ours`: the functions of the modules of the same names, but for their helpers."""


class Row(NamedTuple):
    """A result, what ours is (numbers, or names to numbers), and whether it agrees."""

    source: Source
    result: Result
    ours: list[float] | dict[str, float]

    @property
    def kept(self) -> bool:
        return agrees(self.result, self.ours)


def main(out: Annotated[Path | None, typer.Option(help=_OUT)] = None) -> None:
    """Results that others published, computed with this project's code; exit code 1 if one is out of its tolerance."""
    rows = computed(sources(FOLDER))
    typer.echo(table(rows))
    left = [row for row in rows if not row.kept]
    if left:
        names = ", ".join(f"{short(row.source)}, {row.result.quantity}" for row in left)
        raise ValueError(f"{len(left)} of {len(rows)} published results out of tolerance: {names}")
    if out is not None:
        out.write_text(page(rows), encoding="utf-8")


def sources(folder: Path) -> dict[Path, Source]:
    """All sources of the folder and their files, by year. Raises ConfigError, one sentence, for a file that is none."""
    found = {path: load(path) for path in sorted(folder.glob("*.yaml"))}
    for path, source in found.items():
        for result in source.results:
            if result.ours not in OURS:
                raise ConfigError(f"{path}: ours is {result.ours!r}; it must be one of {', '.join(OURS)}", [])
    return dict(sorted(found.items(), key=lambda item: (item[1].year, item[1].authors)))


def computed(of: dict[Path, Source]) -> list[Row]:
    """A row for each result. Raises ConfigError, one sentence, where ours cannot be compared with what a file says."""
    return [_row(path, number, source) for path, source in of.items() for number in range(len(source.results))]


def _row(path, number, source):
    result = source.results[number]
    ours = OURS[result.ours]()
    if problem := missing(result, ours):
        raise ConfigError(f"{path}: results[{number}] {problem}", [problem])
    return Row(source, result, ours)


def table(rows: Iterable[Row]) -> str:
    """The rows as Markdown."""
    return markdown(HEADS, map(_cells, rows))


def page(rows: list[Row]) -> str:
    """The whole page."""
    notes = "\n".join(_note(source) for source in dict.fromkeys(row.source for row in rows))
    head = (FOLDER / "head.md").read_text(encoding="utf-8")
    return f"{head}\n{table(rows)}\n\n## How ours is computed\n\n{notes}"


def short(source: Source) -> str:
    """Authors by surname, and the year."""
    names = [one.split()[-1] for one in source.authors.split(", ")]
    if len(names) > 1:
        names[-2:] = [f"{names[-2]} and {names[-1]}"]
    return f"{', '.join(names)} {source.year}"


def _note(source):
    cited = f"{source.authors}: *{source.title}*. {source.venue}, {source.year}. <{source.address}>"
    paragraphs = map(_wrapped, (cited, *source.note.strip().split("\n\n")))
    return "\n\n".join((f"### {short(source)}", *paragraphs)) + "\n"


def _wrapped(paragraph):
    return textwrap.fill(paragraph, 120, break_long_words=False, break_on_hyphens=False)


def _cells(row):
    result, unit = row.result, f" {row.result.unit}" if row.result.unit else ""
    published = " > ".join(result.order) if result.kind == ORDER else ", ".join(map(_shown, result.published)) + unit
    ours = _ours_of(row) + unit
    verdict = KEPT if row.kept else LEFT
    link = f"[{short(row.source)}]({row.source.address})"
    return link, result.quantity, published, ours, _tolerance(result), result.kind, verdict


def _ours_of(row):
    if row.result.kind == ORDER:
        return ", ".join(f"{name} {_shown(row.ours[name])}" for name in row.result.order)
    return ", ".join(map(_shown, row.ours))


def _tolerance(result):
    if result.kind == SHAPE:
        return f"factor {result.tolerance:g}"
    percent = f"{100.0 * result.tolerance:g} %"
    return f"± {percent}" if result.kind == EXACT else f"apart by {percent}"


def _shown(value):
    """Three digits, and no sign of zero."""
    return f"{value + 0.0:.3g}" if abs(value) < 1e3 else f"{value:.0f}"
