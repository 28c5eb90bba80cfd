# SPDX-License-Identifier: Apache-2.0
"""Pictures of maps and of runs: what they tell is in their legend, to one scale, in the palette's colours."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from bench.jobs import read_csv
from bench.methods import growth, measure
from bench.methods.figure import LEAST, pareto_figure
from haptic_device.analysis import palette, passivity_figure, zwidth_figure
from haptic_device.analysis.assessment import Display, assess
from haptic_device.analysis.zwidth import NAMES, Outcome, Setup
from haptic_device.analysis.zwidth_map import Plane, Request

ROOT = Path(__file__).parents[2]
STORED = ROOT / "docs" / "benchmarks"


def saved(monkeypatch, save, *words):
    """The figure that `save` writes."""
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
    save(*words, Path("picture.png"))
    return figures[0]


def legend(figure):
    """Words of the only legend."""
    (shown,) = figure.legends or [axes.get_legend() for axes in figure.axes if axes.get_legend()]
    return [text.get_text() for text in shown.get_texts()]


@pytest.mark.parametrize(
    ("stiffness", "verdict", "mark", "colour"),
    [
        (900.0, "passive", palette.PASS_MARK, palette.PASS),
        (1100.0, "not passive", palette.FAIL_MARK, palette.FAIL),
    ],
)
def test_the_verdict_on_a_display_is_told_by_mark_colour_and_word(monkeypatch, stiffness, verdict, mark, colour):
    display = Display(stiffness, 0.0, 0.5, 1e-3, mass=0.1)
    figure = saved(monkeypatch, passivity_figure.save_map, display, assess(display))
    (point,) = (line for line in figure.axes[0].lines if len(line.get_xdata()) == 1)
    assert (point.get_marker(), point.get_color()) == (mark, colour)
    assert f"this display: {verdict}" in legend(figure)
    assert figure.axes[0].get_title() == passivity_figure.TITLE
    assert figure.axes[0].get_legend() is None  # it is below, off the data


@pytest.mark.parametrize("there", [(0,), (0, 2), (0, 1, 2)])
def test_the_legend_of_a_plane_of_cells_has_what_cells_did_and_nothing_else(monkeypatch, there):
    cells = np.resize(np.array(there, dtype=np.int8), (4, 3))
    request = Request(Setup(0.1, 0.5, 1e-3), "none", np.linspace(100.0, 1000.0, 3), np.linspace(0.0, 1.0, 4))
    plane = Plane(Outcome(cells, np.zeros((4, 3)), np.zeros((4, 3))), np.ones(4, dtype=bool))
    figure = saved(monkeypatch, zwidth_figure.save_map, request, plane, 0.0)
    assert [word for word in legend(figure) if word in NAMES] == [NAMES[which] for which in there]
    assert figure.axes[0].get_legend() is None
    assert "m = 0.1 kg" in figure.legends[0].get_title().get_text()


def test_the_picture_of_speed_and_error_is_of_the_stored_runs_to_one_scale_with_its_ring_in_the_legend():
    runs = read_csv(STORED / "speed_error.csv", measure.Run)
    figure = pareto_figure(runs)
    assert [axes.get_title() for axes in figure.axes] == list(dict.fromkeys(item.scene for item in runs))
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in figure.axes}) == 1
    assert {"partitioned", "the scene's own method and step"} <= set(legend(figure))
    drawn = [float(x) for axes in figure.axes for line in axes.lines for x in line.get_xdata()]
    assert min(drawn) == LEAST
    assert min(item.error for item in runs if item.counts) < LEAST


def test_a_method_has_one_colour_in_both_pictures_of_the_runs():
    one = pareto_figure(read_csv(STORED / "speed_error.csv", measure.Run))
    other = growth.figure(read_csv(STORED / "growth.csv", growth.Run))
    for figure in (one, other):
        lines = figure.legends[0].get_lines() if figure.legends else figure.axes[-1].get_legend().get_lines()
        colours = dict(zip(legend(figure), (line.get_color() for line in lines), strict=False))
        assert colours["impulse"] == palette.METHODS["impulse"].colour
        assert colours["partitioned"] == palette.METHODS["partitioned"].colour


def test_the_picture_of_growth_has_no_empty_panel_and_says_which_bodies():
    figure = growth.figure(read_csv(STORED / "growth.csv", growth.Run))
    *shown, last = figure.axes
    assert all(axes.lines and axes.get_title() for axes in shown)
    assert last.get_legend() and not last.axison
    assert len({axes.get_ylim() for axes in shown}) == 1
    assert [axes.get_title().split(":")[0] for axes in shown] == list(growth.WORLDS)


@pytest.mark.parametrize(
    "page", ["theory/passivity.md", "how_to/zwidth.md", "theory/methods.md", "reference/scenes/README.md"]
)
def test_every_picture_in_the_documents_says_what_is_on_it(page):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    words = re.findall(r"!\[([^\]]*)\]\(", text) + re.findall(r'<img [^>]*alt="([^"]*)"', text)
    assert len(words) == len(re.findall(r"!\[|<img ", text))
    assert [alt for alt in words if len(alt.split()) < 3] == []
