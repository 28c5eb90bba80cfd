# SPDX-License-Identifier: Apache-2.0
"""Pictures of maps and of runs: what they tell is in their legend, to one scale, in the palette's
colours, which colour-blind eyes tell apart."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from bench.jobs import read_csv
from bench.methods import measure
from bench.methods.figure import pareto_figure
from haptic_device.theory import palette, passivity_figure
from haptic_device.theory.assessment import Display, assess
from haptic_display import page as viewer
from haptic_display.page.film import gif
from haptic_display.run.report import curves
from haptic_sim import method_registry

ROOT = Path(__file__).parents[2]
STORED = ROOT / "docs" / "benchmarks"
OF_COLOURS = ("palette.py", "style.py")
EYES = {
    "usual": np.eye(3),
    "protanope": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranope": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}
"""Linear RGB as such an eye sees it: Machado, Oliveira & Fernandes (2009), severity 1."""
TO_XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
WHITE = [0.95047, 1.0, 1.08883]
APART = 15.0  # CIE 1976 colour difference; 2.3 is just noticeable side by side
PLANE = ("handle", "tool", "fixed", "moving", "coupling", "force", "contact", "target")
FAMILIES = {
    "methods": {name: look.colour for name, look in palette.METHODS.items()},
    "runs": {number: look.colour for number, look in enumerate(palette.RUNS)},
    "plane": {name: getattr(palette, name.upper()) for name in PLANE},
    "cells": dict(enumerate(palette.CELLS)),
    "pass and fail": {"pass": palette.PASS, "fail": palette.FAIL},
}


def linear(colour):
    """Red, green, blue of #rrggbb, proportional to light."""
    value = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def lab(colour, eye):
    """CIE L*, a*, b* of a colour as an eye sees it."""
    seen = np.array(TO_XYZ) @ np.clip(np.array(EYES[eye]) @ linear(colour), 0.0, 1.0) / WHITE
    root = np.where(seen > 216 / 24389, np.cbrt(seen), (24389 / 27 * seen + 16) / 116)
    return np.array([116 * root[1] - 16, 500 * (root[0] - root[1]), 200 * (root[1] - root[2])])


def difference(one, other, eye):
    """CIE 1976 colour difference."""
    return float(np.linalg.norm(lab(one, eye) - lab(other, eye)))


@pytest.mark.parametrize(
    ("stiffness", "verdict", "mark", "colour"),
    [(900.0, "passive", palette.PASS_MARK, palette.PASS), (1100.0, "not passive", palette.FAIL_MARK, palette.FAIL)],
)
def test_the_verdict_on_a_display_is_told_by_mark_colour_and_word(monkeypatch, stiffness, verdict, mark, colour):
    saved, display = [], Display(stiffness, 0.0, 0.5, 1e-3, mass=0.1)
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: saved.append(figure))
    passivity_figure.save_map(display, assess(display), Path("picture.png"))
    (point,) = (line for line in saved[0].axes[0].lines if len(line.get_xdata()) == 1)
    assert (point.get_marker(), point.get_color()) == (mark, colour)
    assert f"this display: {verdict}" in [text.get_text() for text in saved[0].legends[0].get_texts()]


def test_panels_of_the_stored_runs_are_to_one_scale():
    runs = read_csv(STORED / "speed_error.csv", measure.Run)
    errors = pareto_figure(runs)
    assert [axes.get_title() for axes in errors.axes] == list(dict.fromkeys(item.scene for item in runs))
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in errors.axes}) == 1


def test_no_two_colours_of_a_picture_look_alike_to_anybody():
    for family, eye in itertools.product(FAMILIES.values(), EYES):
        for one, other in itertools.combinations(family, 2):
            assert difference(family[one], family[other], eye) >= APART, (one, other, eye)
    green, brick = "#2ca02c", "#d06040"  # far apart, and one to a deuteranope
    assert difference(green, brick, "usual") > 5.0 * APART
    assert difference(green, brick, "deuteranope") < 2.3


def test_every_method_has_a_look_and_lines_differ_without_colour_too():
    assert set(palette.METHODS) == set(method_registry.METHODS)
    looks = palette.METHODS | palette.PEERS
    assert len({look.mark for look in looks.values()}) == len(looks)
    assert len({look.dashes for look in palette.RUNS}) == len(palette.RUNS)
    assert palette.PASS_MARK != palette.FAIL_MARK
    assert len(set(palette.HATCHES)) == len(palette.CELLS)


def test_the_plane_has_the_colours_of_the_page_and_no_picture_one_that_is_not_of_the_palette():
    sheet = (Path(viewer.__file__).parent / "web" / "style.css").read_text(encoding="utf-8")
    light = dict(re.findall(r"--([a-z]+): (#[0-9a-f]{6})", sheet[sheet.index(":root {") : sheet.index("}")]))
    assert {name: light[name] for name in PLANE} == FAMILIES["plane"]
    folders = [Path(room.__file__).parent for room in (palette, curves)]
    pages = [source for folder in folders for source in folder.rglob("*.py") if source.name not in OF_COLOURS]
    texts = {str(source): source.read_text(encoding="utf-8") for source in [*pages, Path(gif.__file__)]}
    assert len(texts) > 20 and [name for name, text in texts.items() if re.search(r"#[0-9a-fA-F]{6}\b", text)] == []
    colours = {value for value in vars(palette).values() if isinstance(value, str) and value.startswith("#")}
    assert {*curves.COLOURS, *(look.colour for look in palette.RUNS)} <= colours
