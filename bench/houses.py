# SPDX-License-Identifier: Apache-2.0
"""The three packages as houses: rooms on floors, and who imports whom, read from the code and drawn as SVG.

A room is a folder or a file at the root of a package. It stands a floor above the highest that it imports. Of the
imports between rooms those are drawn that no longer way implies; between houses each one goes down. A module that is
named in a text, as the tables of methods and links do, is no import.
"""

import ast
from itertools import combinations, pairwise, permutations
from operator import itemgetter
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.theory.palette import GREEN, GROUND, HANDLE, INK, TOOL

ROOT = Path(__file__).parents[1]
HOUSES = {"haptic_display": "what people touch", "haptic_sim": "what simulates", "haptic_device": "what moves a handle"}
PICTURE = ROOT / "docs/figures/houses.svg"
ROOF, FLOOR, GAP = 56, 56, 28  # pixels
SLOT, SLOTS = 105, range(-3, 4)  # pixels between the places of a floor; these, from the middle: a room takes two

Rooms = dict[str, set[str]]
"""{room: rooms of the same package that it imports}."""
Place = tuple[int, str]
"""A floor, and the room that stands there or the arrow that goes through."""


def main(out: Annotated[Path, typer.Option(show_default="docs/figures/houses.svg")] = PICTURE) -> None:
    """Print the floors of each package and draw them; ends with a sentence at an arrow up or a circle."""
    houses = {house: rooms_of(house) for house in HOUSES}
    for house, rooms in houses.items():
        print(house, *(f"{k:3}  {', '.join(row)}" for k, row in [*enumerate(floors(house, rooms), 1)][::-1]), sep="\n")
    out.write_text(drawn(houses), encoding="utf-8")


def rooms_of(house: str) -> Rooms:
    """The rooms of a package. Raises ValueError, one sentence, at an import of a package above."""
    rooms: Rooms = {}
    for file in sorted((ROOT / house).rglob("*.py")):
        room = rooms.setdefault(file.relative_to(ROOT / house).parts[0].removesuffix(".py"), set())
        for package, _, name in (imported.partition(".") for imported in _imported_by(file)):
            if package in [*HOUSES][: [*HOUSES].index(house)]:
                raise ValueError(f"{file.relative_to(ROOT)} imports {package}.{name}: {package} stands above {house}")
            room |= {name.split(".")[0]} if package == house else set()
    return {room: imported & rooms.keys() - {room} for room, imported in rooms.items() if room != "__init__"}


def _imported_by(file: Path) -> list[str]:
    nodes = [*ast.walk(ast.parse(file.read_text(encoding="utf-8")))]
    froms = [f"{node.module}.{each.name}" for node in nodes if isinstance(node, ast.ImportFrom) for each in node.names]
    return froms + [each.name for node in nodes if isinstance(node, ast.Import) for each in node.names]


def floors(house: str, rooms: Rooms) -> list[list[str]]:
    """The rooms of each floor, from the ground. Raises ValueError, one sentence, at a circle."""
    rows: list[list[str]] = []
    while left := sorted(rooms.keys() - {room for row in rows for room in row}):
        rows.append([room for room in left if not rooms[room] & {*left}])
        if not rows[-1]:
            raise ValueError(f"{house}: imports among {', '.join(left)} go in a circle")
    return rows


def needed(rooms: Rooms) -> list[tuple[str, str]]:
    """The imports that no longer way implies."""

    def reached(room: str) -> set[str]:
        return rooms[room].union(*map(reached, rooms[room]))

    return [(a, b) for a in rooms for b in sorted(rooms[a]) if not any(b in reached(c) for c in rooms[a] - {b})]


def drawn(houses: dict[str, Rooms]) -> str:
    """The picture's text. An arrow goes through the floors between its ends in places of its own."""
    shapes, top = list[str](), 1
    for (house, rooms), colour in zip(houses.items(), (GREEN, TOOL, HANDLE), strict=True):
        rows = [[(k, room) for room in row] for k, row in enumerate(floors(house, rooms))]
        level, hops = {room: k for row in rows for k, room in row}, list[tuple[Place, Place]]()
        for a, b in needed(rooms):
            for k in range(level[b] + 1, level[a]):
                rows[k].append((k, f"{a}>{b}"))
            hops += pairwise(place for row in reversed(rows) for place in row if place[1] in (a, f"{a}>{b}", b))
        at, end = _placed(rows, hops), ROOF + FLOOR * len(rows)
        spot = {place: (400 + SLOT * at[place], end - FLOOR * place[0] - 30) for place in at}
        shapes.append(HOUSE.format(house=house, what=HOUSES[house], colour=colour, top=top, end=end))
        for upper, lower in hops:
            (x, y), (u, v) = spot[upper], spot[lower]
            rest = ' v30"' if ">" in lower[1] else '" marker-end="url(#tip)"'
            shapes.append(f'<path d="M{x} {y + 15} C{x} {(y + v) // 2} {u} {(y + v) // 2} {u} {v - 15}{rest}/>')
        for room, k in level.items():
            shapes.append(ROOM.format(*spot[k, room], room, "room" if (ROOT / house / room).is_dir() else "file"))
        shapes[-1], top = shapes[-1] + "</g>", top + end + GAP
    return SVG.format(high=top - GAP + 1, ink=INK, ground=GROUND, shapes="\n".join(shapes))


def _placed(rows: list[list[Place]], hops: list[tuple[Place, Place]]) -> dict[Place, int]:
    """The slots of fewest crossings, then of straightest arrows: for each choice on a floor the best one below it."""
    best: list[tuple[float, dict[Place, int]]] = [(0.0, {})]
    for row in rows:
        tried = [[(cost + _cost(new, at, hops), at | new) for cost, at in best] for new in _fitting(row)]
        best = [min(each, key=itemgetter(0)) for each in tried]
    return min(best, key=itemgetter(0))[1]


def _fitting(row: list[Place]) -> list[dict[Place, int]]:
    rooms = [place for place in row if ">" not in place[1]]
    tried = [dict(zip(row, slots, strict=True)) for slots in permutations(SLOTS, len(row))]
    return [at for at in tried if all(abs(at[a] - at[b]) > 1 for a, b in combinations(rooms, 2))]


def _cost(new: dict[Place, int], at: dict[Place, int], hops: list[tuple[Place, Place]]) -> float:
    ends = [(new[a], at[b]) for a, b in hops if a in new]
    crossed = sum((a - c) * (b - d) < 0 for (a, b), (c, d) in combinations(ends, 2))
    return 100 * crossed + sum((a - b) ** 2 for a, b in ends) + sum(slot**2 for slot in new.values()) / 100


HOUSE = """<g fill="{colour}" transform="translate(0 {top})"><path d="M400 -28 V0" marker-end="url(#tip)"/>
<path class="house" d="M400 0 L4 44 V{end} H796 V44 Z"/>
<text x="400" y="34"><tspan font-weight="bold">{house}</tspan>: {what}</text>"""
ROOM = """<rect class="{3}" x="{0}" y="{1}" width="142" height="30" rx="4" transform="translate(-71 -15)"/>
<text x="{0}" y="{1}" dy="5">{2}</text>"""
SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 800 {high}" role="img">
<!-- SPDX-License-Identifier: Apache-2.0; made by `python -m bench houses` --><title>Packages and their rooms</title>
<style>text {{ font: 14px "DejaVu Sans", Verdana, Arial, sans-serif; fill: {ink}; text-anchor: middle }}
path {{ fill: none; stroke: {ink}; stroke-width: 1.3 }} rect {{ stroke: {ink}; fill-opacity: 0.25 }}
.house {{ fill: {ground} }} .file {{ fill: white; fill-opacity: 1 }}</style>
<marker id="tip" refX="3" refY="6" markerWidth="6" markerHeight="6"><polygon points="0,0 6,0 3,6"/></marker>
{shapes}</svg>
"""
