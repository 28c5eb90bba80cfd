# SPDX-License-Identifier: Apache-2.0
"""The film of a scene shows what a person would do in it, and all that moves."""

import math

import numpy as np
import pytest
from PIL import Image, ImageColor

from haptic_device.theory.palette import MOVING
from haptic_display.page.film.curves import HANDLE
from haptic_display.page.film.gif import pictures_of, write_gif
from haptic_display.page.film.scene_run import film_of_scene
from haptic_sim.scene.language import load
from haptic_sim.scene.shapes import TOOL


def test_the_film_of_a_task_shows_it_done_by_the_force_of_the_coupling():
    """The peg goes to the bottom of its hole; test/soak/test_gallery.py has the other tasks."""
    film, deep = film_of_scene(load("peg_in_hole")), load("peg_in_hole").measure["insertion_fraction"]
    x, y, angle = film.places[TOOL][-1]
    tip = -np.dot((x - np.sin(angle) * deep.point[1], y + np.cos(angle) * deep.point[1]), (0.0, 1.0))
    assert (tip - deep.start) / (deep.end - deep.start) == pytest.approx(1.0, abs=0.01)
    apart = film.places[TOOL][-1] - film.places[HANDLE][-1]
    assert film.force[-1] == pytest.approx(2000.0 * apart[:2], abs=0.1)
    assert pictures_of(film, math.inf)[-1] > 0.9 * film.pictures, "a picture of the end is among those of the gallery"


def test_a_scene_without_a_way_is_shown_while_its_motion_lasts_and_a_body_as_thin_as_a_dot_is_drawn(tmp_path):
    film, wanted = film_of_scene(load("falling_rod")), ImageColor.getrgb(MOVING)
    left, bottom, right, top = film.room
    x, y, _ = film.places["rod"].T
    assert film.pictures > 60 and len(x) == film.pictures
    assert left < x.min() and x.max() < right and bottom < y.min() and y.max() < top
    write_gif(film, tmp_path / "film.gif", math.inf)
    with Image.open(tmp_path / "film.gif") as pictures:
        for number in range(pictures.n_frames):
            pictures.seek(number)
            colours = {colour for _, colour in pictures.convert("RGB").getcolors(1 << 20)}
            assert any(sum(map(abs, np.subtract(one, wanted))) < 30 for one in colours), number
