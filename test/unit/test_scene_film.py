# SPDX-License-Identifier: Apache-2.0
"""The film of a scene shows what a person would do in it: the peg goes in, or jams; the nut turns."""

import math

import numpy as np
import pytest
from PIL import Image, ImageColor

from haptic_device.analysis.palette import MOVING
from haptic_sim.film.curves import HANDLE
from haptic_sim.film.gif import pictures_of, write_gif
from haptic_sim.film.scene_run import film_of_scene
from haptic_sim.scene.language import load
from haptic_sim.scene.shapes import TOOL
from haptic_sim.viewer.tasks import tasks


@pytest.fixture(scope="module")
def peg():
    return film_of_scene(load("peg_in_hole"))


def test_the_peg_goes_to_the_bottom_of_its_hole(peg):
    x, y, angle = peg.places[TOOL][-1]
    deep = load("peg_in_hole").measure["insertion_fraction"]
    tip = -np.dot((x - np.sin(angle) * deep.point[1], y + np.cos(angle) * deep.point[1]), (0.0, 1.0))
    assert (tip - deep.start) / (deep.end - deep.start) == pytest.approx(1.0, abs=0.01)


def test_the_jammed_peg_stays_where_it_is_under_the_hand_that_pushes_it():
    film = film_of_scene(load("peg_jammed"))
    assert np.abs(film.places[TOOL][:, 1] - film.places[TOOL][0, 1]).max() < 5e-4
    assert np.linalg.norm(film.force[-1]) > 1.0 and film.contacts


def test_the_nut_turns_by_a_third_of_a_turn_and_not_by_half_a_turn():
    scene = load("wrench_on_nut")
    goal = scene.task.done["turned"] * scene.measure["turned"].end
    assert goal < film_of_scene(scene).places["nut"][-1, 2] < np.pi


def test_the_force_is_that_of_the_coupling_between_handle_and_tool(peg):
    last = peg.places[TOOL][-1] - peg.places[HANDLE][-1]
    assert peg.force[-1] == pytest.approx(2000.0 * last[:2], abs=0.1)


def test_a_body_that_falls_beside_the_tool_is_in_the_picture():
    film = film_of_scene(load("pendulum"))
    left, bottom, right, top = film.room
    x, y, _ = film.places["rod"].T
    assert left < x.min() and x.max() < right and bottom < y.min() and y.max() < top


def test_a_scene_without_a_way_is_shown_for_as_long_as_its_motion_lasts():
    film = film_of_scene(load("falling_rod"))
    assert film.pictures > 60 and len(film.places["rod"]) == film.pictures


@pytest.mark.parametrize("name", [task["name"] for task in tasks()])
def test_a_film_of_the_gallery_shows_the_task_done(name):
    scene = load(name)
    film = film_of_scene(scene)
    shown = pictures_of(film, math.inf)
    for measure, least in scene.task.done.items():
        poses = film.places[scene.measure[measure].body][shown]
        assert max(scene.measure[measure].fraction(pose) for pose in poses.tolist()) >= least


def test_a_body_thinner_than_a_picture_s_dot_is_still_drawn(tmp_path):
    film, wanted = film_of_scene(load("falling_rod")), ImageColor.getrgb(MOVING)
    write_gif(film, tmp_path / "film.gif", math.inf)
    with Image.open(tmp_path / "film.gif") as pictures:
        for number in range(pictures.n_frames):
            pictures.seek(number)
            colours = {colour for _, colour in pictures.convert("RGB").getcolors(1 << 20)}
            assert any(sum(map(abs, np.subtract(one, wanted))) < 30 for one in colours), number
