# SPDX-License-Identifier: Apache-2.0
"""The film of each scene with a task shows the task done, and that of a jammed peg that it jams."""

import math

import numpy as np
import pytest

from haptic_display.page.film.gif import pictures_of
from haptic_display.page.film.scene_run import film_of_scene
from haptic_display.page.tasks import tasks
from haptic_sim.scene.language import load
from haptic_sim.scene.shapes import TOOL


@pytest.mark.parametrize("name", [task["name"] for task in tasks()])
def test_a_film_of_the_gallery_shows_the_task_done(name):
    scene = load(name)
    film = film_of_scene(scene)
    shown = pictures_of(film, math.inf)
    for measure, least in scene.task.done.items():
        poses = film.places[scene.measure[measure].body][shown]
        assert max(scene.measure[measure].fraction(pose) for pose in poses.tolist()) >= least
    assert name != "wrench_on_nut" or film.places["nut"][-1, 2] < np.pi, "by a third of a turn, not by half a turn"


def test_the_jammed_peg_stays_where_it_is_under_the_hand_that_pushes_it():
    film = film_of_scene(load("peg_jammed"))
    assert np.abs(film.places[TOOL][:, 1] - film.places[TOOL][0, 1]).max() < 5e-4
    assert np.linalg.norm(film.force[-1]) > 1.0 and film.contacts
