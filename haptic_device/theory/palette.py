# SPDX-License-Identifier: Apache-2.0
"""Colours, marks and dashes of all pictures: what a thing looks like is the same everywhere, for colour-blind eyes too.

The hues are those of Okabe & Ito (Color Universal Design, 2008). Handle, tool and what else is in the plane are as on
the page (page/web/style.css, light). Nothing is told by colour alone: lines differ by dashes or marks too.
"""

from typing import Any, NamedTuple

BLUE, ORANGE, GREEN, VERMILION = "#0072b2", "#e69f00", "#009e73", "#d55e00"
SKY, PURPLE, BLACK, GREY = "#56b4e9", "#cc79a7", "#000000", "#808080"

HANDLE, TOOL, COUPLING, FORCE, MOVING = BLUE, ORANGE, GREEN, VERMILION, SKY
FIXED, CONTACT, TARGET = "#9aa3ad", "#a3457f", "#30363d"
GROUND, INK, WALL = "#f6f7f9", "#16191d", "#b7d0df"

PASS, FAIL = BLUE, VERMILION
PASS_MARK, FAIL_MARK = "o", "X"
CELLS = ("#d6ecf8", "#e9b949", "#d98a63")
"""Of a plane of cells, from good to bad; lighter is better."""
HATCHES, HATCHED = ("", "..", "//"), "#9c4a22"
"""The same without colour, and in which colour."""

SOLID, DASHED, DOTTED, MIXED = (0, ()), (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2))

Dashes = tuple[int, tuple[float, ...]]
"""As matplotlib's linestyle takes them."""


class Look(NamedTuple):
    """Colour, mark and dashes of a line."""

    colour: str
    mark: str
    dashes: Dashes = SOLID

    @property
    def line(self) -> dict[str, Any]:
        """The same as keywords of matplotlib's plot()."""
        return {"color": self.colour, "marker": self.mark, "linestyle": self.dashes}


METHODS = {
    "impulse": Look(BLUE, "o"),
    "penalty_explicit": Look(VERMILION, "v", DOTTED),
    "penalty_implicit": Look(ORANGE, "^", DASHED),
    "partitioned": Look(GREEN, "s"),
    "event_driven": Look(SKY, "p", DASHED),
    "closed_form": Look(PURPLE, "D"),
}
"""Each simulation method; other engines are in grey and black."""
PEERS = {
    "pymunk": Look(GREY, "1"),
    "box2d": Look(BLACK, "2"),
    "mujoco_rk4": Look(GREY, "+", DASHED),
    "mujoco_implicit": Look(BLACK, "x", DASHED),
}
RUNS = (
    Look(BLUE, "o"),
    Look(VERMILION, "s", (0, (6, 2))),
    Look(GREEN, "^", (0, (2, 1))),
    Look(PURPLE, "D", MIXED),
    Look(BLACK, "v", (0, (1, 1))),
    Look(ORANGE, "p", (0, (10, 2))),
)
"""Runs over each other."""
