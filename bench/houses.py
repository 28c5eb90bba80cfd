# SPDX-License-Identifier: Apache-2.0
"""The three packages as houses: rooms on floors, and who imports whom, read from the code and drawn as SVG.

A room is a folder or a file at the root of a package. It stands a floor above the highest that it imports. Of the
imports between rooms those are drawn that no longer way implies; between houses each one goes down.
"""

import ast
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.theory.palette import CELLS, GROUND, INK

ROOT = Path(__file__).parents[1]
HOUSES = {
    "haptic_display": "what people touch",
    "haptic_sim": "what simulates",
    "haptic_device": "what moves a handle",
}
PICTURE = ROOT / "docs/figures/houses.svg"
WIDTH, FLOOR, BOX, LETTER, HEAD, GAP = 800, 62, 30, 8.2, 34, 22  # pixels

Rooms = dict[str, set[str]]
"""{room: rooms of the same package that it imports}."""


def main(out: Annotated[Path, typer.Option(show_default="docs/figures/houses.svg")] = PICTURE) -> None:
    """Print the floors of each package and draw them."""
    houses = {house: rooms_of(house) for house in HOUSES}
    for house, rooms in houses.items():
        print(
            house, *(f"  {k}  {' '.join(row)}" for k, row in reversed([*enumerate(floors(house, rooms), 1)])), sep="\n"
        )
    out.write_text(drawn(houses))


def imports_of(file: Path) -> set[str]:
    """Full names of what a file imports, as far as they are ours."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name.split(".")[0] in HOUSES}


def rooms_of(house: str) -> Rooms:
    """The rooms of a package. Raises ValueError, one sentence, at an import of a package above."""
    rooms: Rooms = {}
    below = [*HOUSES][[*HOUSES].index(house) :]
    for file in sorted((ROOT / house).rglob("*.py")):
        room = file.relative_to(ROOT / house).parts[0]
        if room == "__init__.py":
            continue
        own = rooms.setdefault(room.removesuffix(".py"), set())
        for name in imports_of(file):
            if (package := name.split(".")[0]) not in below:
                raise ValueError(f"{file.relative_to(ROOT)} imports {name}: {package} stands above {house}")
            own |= {name.split(".")[1]} if package == house else set()
    return {room: imported & rooms.keys() - {room} for room, imported in rooms.items()}


def floors(house: str, rooms: Rooms) -> list[list[str]]:
    """The rooms of each floor, from the ground. Raises ValueError, one sentence, at a circle."""
    rows: list[list[str]] = []
    placed: set[str] = set()
    while left := rooms.keys() - placed:
        row = sorted(room for room in left if rooms[room] <= placed)
        if not row:
            raise ValueError(f"{house}: {', '.join(sorted(left))} import each other in a circle")
        rows.append(row)
        placed |= set(row)
    return rows


def needed(rooms: Rooms) -> list[tuple[str, str]]:
    """The imports that no longer way implies."""

    def reached(room: str) -> set[str]:
        return rooms[room].union(*map(reached, rooms[room]))

    return [(a, b) for a in rooms for b in sorted(rooms[a]) if not any(b in reached(c) for c in rooms[a] - {b})]


def drawn(houses: dict[str, Rooms]) -> str:
    """The picture's text: an arrow passes the floors between its ends in a place of its own."""
    shapes, top = [], 0.0
    for house, rooms in houses.items():
        rows: list[list[str]] = floors(house, rooms)
        level = {room: k for k, row in enumerate(rows) for room in row}
        ways = [[a, *(f"{a}>{b}@{k}" for k in range(level[a] - 1, level[b], -1)), b] for a, b in needed(rooms)]
        for way in ways:
            for k, place in enumerate(way[1:-1], 1):
                rows[level[way[0]] - k].append(place)
        at = _spread(rows, ways)
        high = HEAD + FLOOR * len(rows)
        shapes.append(f'<rect class="house" x="4" y="{top + 4:g}" width="{WIDTH - 8}" height="{high - 8:g}" rx="8"/>')
        shapes.append(f'<text class="name" x="18" y="{top + 28:g}">{house}</text>')
        shapes.append(f'<text x="{30 + LETTER * 1.15 * len(house):g}" y="{top + 28:g}">{HOUSES[house]}</text>')
        y = {place: top + high - FLOOR * (k + 0.5) for k, row in enumerate(rows) for place in row}
        for way in ways:
            points = [(at[place], y[place]) for place in way]
            path = f"M {points[0][0]:.0f} {points[0][1] + BOX / 2:.0f}"
            for (x0, y0), (x1, y1) in zip(points, points[1:], strict=False):
                y0, y1 = y0 + BOX / 2, y1 - BOX / 2 - (6 if (x1, y1) == points[-1] else 0)
                path += f" C {x0:.0f} {(y0 + y1) / 2:.0f} {x1:.0f} {(y0 + y1) / 2:.0f} {x1:.0f} {y1:.0f}"
                path += f" L {x1:.0f} {y1 + BOX:.0f}" * ((x1, y1 + BOX / 2) in points[1:-1])
            shapes.append(f'<path d="{path}"/>')
        for room in rooms:
            wide = LETTER * len(room) + 18
            kind = "room" if (ROOT / house / room).is_dir() else "file"
            box = f'x="{at[room] - wide / 2:.0f}" y="{y[room] - BOX / 2:.0f}" width="{wide:.0f}" height="{BOX}" rx="4"'
            shapes.append(f'<rect class="{kind}" {box}/>')
            shapes.append(f'<text class="label" x="{at[room]:.0f}" y="{y[room] + 5:.0f}">{room}</text>')
        top += high
        if house != [*HOUSES][-1]:
            shapes.append(f'<path d="M {WIDTH / 2} {top - 2:g} L {WIDTH / 2} {top + GAP - 4:g}"/>')
            top += GAP
    return SVG.format(width=WIDTH, height=top, ink=INK, ground=GROUND, room=CELLS[0], shapes="\n".join(shapes))


def _spread(rows: list[list[str]], ways: list[list[str]]) -> dict[str, float]:
    """Where each place of each row stands across the picture: near what it is tied to, so that few arrows cross."""
    tied: dict[str, list[str]] = {}
    for way in ways:
        for a, b in zip(way, way[1:], strict=False):
            tied.setdefault(a, []).append(b)
            tied.setdefault(b, []).append(a)
    at: dict[str, float] = {}
    for _ in range(12):
        for row in rows:
            near = {p: [at[q] for q in tied.get(p, []) if q in at] or [WIDTH / 2] for p in row}
            row[:] = [p for _, p in sorted((sum(near[p]) / len(near[p]), p) for p in row)]
            wide = [18.0 if ">" in place else LETTER * len(place) + 18 for place in row]
            free = (WIDTH - 40 - sum(wide)) / (len(row) + 1)
            x = 20.0
            for place, own in zip(row, wide, strict=True):
                at[place] = x + free + own / 2
                x += free + own
    return at


SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:g}" role="img"
aria-labelledby="title desc">
<!-- SPDX-License-Identifier: Apache-2.0; made by `python -m bench houses` -->
<title id="title">Three packages and their rooms</title>
<desc id="desc">haptic_display stands on haptic_sim, which stands on haptic_device. In each, rooms stand on floors, and
every arrow of an import goes down.</desc>
<style>
text {{ font: 14px "DejaVu Sans", Verdana, Arial, sans-serif; fill: {ink}; }}
.name {{ font-weight: bold; }}
.label {{ text-anchor: middle; }}
.house {{ fill: {ground}; stroke: {ink}; }}
.room {{ fill: {room}; stroke: {ink}; }}
.file {{ fill: #ffffff; stroke: {ink}; }}
path {{ fill: none; stroke: {ink}; stroke-width: 1.2; marker-end: url(#tip); }}
</style>
<defs><marker id="tip" viewBox="0 0 10 10" refX="4" refY="5" markerWidth="7" markerHeight="7" orient="auto">
<polygon points="0,0 10,5 0,10" fill="{ink}"/></marker></defs>
{shapes}
</svg>
"""
