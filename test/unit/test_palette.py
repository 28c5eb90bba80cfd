# SPDX-License-Identifier: Apache-2.0
"""Colours of pictures: one for each method, those of the page, told apart by colour-blind eyes."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from haptic_device.analysis import palette
from haptic_device.analysis.report import curves
from haptic_device.parameters import EXCHANGE_METHODS
from haptic_sim import method_registry
from haptic_sim.film import gif

EYES = {
    "usual": np.eye(3),
    "protanope": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranope": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}
"""Linear RGB as such an eye sees it: Machado, Oliveira & Fernandes (2009), severity 1."""
TO_XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
WHITE = [0.95047, 1.0, 1.08883]
APART = 15.0  # CIE 1976 colour difference; 2.3 is just noticeable side by side
FAMILIES = {
    "methods": {name: look.colour for name, look in palette.METHODS.items()},
    "exchanges": {name: look.colour for name, look in palette.EXCHANGES.items()},
    "runs": {number: look.colour for number, look in enumerate(palette.RUNS)},
    "plane": {
        name: getattr(palette, name.upper())
        for name in ("handle", "tool", "fixed", "moving", "coupling", "force", "contact", "target")
    },
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


def test_every_simulation_method_and_every_exchange_method_has_a_look():
    assert set(palette.METHODS) == set(method_registry.METHODS)
    assert set(palette.EXCHANGES) == set(EXCHANGE_METHODS)


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("family", FAMILIES)
def test_no_two_colours_of_a_picture_look_alike_to_anybody(family, eye):
    alike = [
        (one, other, difference(FAMILIES[family][one], FAMILIES[family][other], eye))
        for one, other in itertools.combinations(FAMILIES[family], 2)
        if difference(FAMILIES[family][one], FAMILIES[family][other], eye) < APART
    ]
    assert alike == []


def test_a_green_and_a_brick_red_are_far_apart_and_one_to_a_deuteranope():
    pair = "#2ca02c", "#d06040"
    assert difference(*pair, "usual") > 5.0 * APART
    assert difference(*pair, "deuteranope") < 2.3


def test_lines_differ_without_colour_too():
    for looks in (palette.METHODS | palette.PEERS, palette.EXCHANGES):
        assert len({look.mark for look in looks.values()}) == len(looks)
    assert len({look.dashes for look in palette.RUNS}) == len(palette.RUNS)
    assert palette.PASS_MARK != palette.FAIL_MARK
    assert len(set(palette.HATCHES)) == len(palette.CELLS)


def test_the_plane_has_the_colours_of_the_page():
    import haptic_sim.viewer

    sheet = (Path(haptic_sim.viewer.__file__).parent / "web" / "style.css").read_text(encoding="utf-8")
    light = dict(re.findall(r"--([a-z]+): (#[0-9a-f]{6})", sheet[sheet.index(":root {") : sheet.index("}")]))
    assert {name: light[name] for name in FAMILIES["plane"]} == FAMILIES["plane"]


def test_no_picture_has_a_colour_that_is_not_of_the_palette():
    folder, pages = Path(palette.__file__).parent, ("palette.py", "style.py")
    pictures = [source for source in folder.rglob("*.py") if source.name not in pages] + [Path(gif.__file__)]
    with_colours = [each.name for each in pictures if re.search(r"#[0-9a-fA-F]{6}\b", each.read_text(encoding="utf-8"))]
    assert len(pictures) > 20 and with_colours == []


def test_the_curves_of_a_report_have_the_colours_of_the_palette():
    colours = {value for value in vars(palette).values() if isinstance(value, str) and value.startswith("#")}
    assert {*curves.COLOURS, *(look.colour for look in palette.RUNS)} <= colours
