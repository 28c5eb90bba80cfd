# SPDX-License-Identifier: Apache-2.0
"""A film of a scene that nobody has recorded: the simulated hand leads the tool in lock-step, with the demo's gains."""

import numpy as np
import numpy.typing as npt

from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_device.config.parameter_files import read_operating_point
from haptic_device.config.parameter_types import defaults
from haptic_display.page.film.clock import RATE, Array
from haptic_display.page.film.curves import HANDLE, NOT_HELD
from haptic_display.page.film.reading import Film, room_of
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import SECOND, Lockstep
from haptic_sim.lockstep.recorded_operator import PlayedTarget
from haptic_sim.node.parameters import NODES
from haptic_sim.protocol import World
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

ARM = 0.05  # [m] way that turning by a radian counts as
BEFORE, AFTER = 0.5, 0.5  # [s] that the hand rests at both ends of the way
Shown = tuple[dict[str, Array], Array, npt.NDArray[np.bool_], list[tuple[int, float, float, float, float]]]
"""Places, force, coupled and contacts of a Film."""


def film_of_scene(scene: Scene) -> Film:
    """The way of the scene's task, else that of its motion, once."""
    names = [HANDLE, TOOL, *(body.name for body in scene.bodies if not body.fixed)]
    places, force, coupled, contacts = _run(scene, names)
    drawing = drawing_of(scene)
    return Film(
        name=scene.name,
        scene=drawing,
        date="",
        facts=[],
        notes=[],
        rate=RATE,
        begin=0.0,
        places=places,
        curves={},
        force=force,
        coupled=coupled,
        contacts=contacts,
        marks=[],
        first_contact=next((picture / RATE for picture, *_ in contacts), None),
        room=room_of(places, drawing),
        walls=[],
    )


def _run(scene: Scene, names: list[str]) -> Shown:
    """The display, led along the way, at the times of the pictures."""
    hand = _hand(scene)
    system, method = _system(scene, hand)
    hand.begin(system)
    places: dict[str, list[tuple[float, ...]]] = {name: [] for name in names}
    force, coupled, contacts = [], [], []
    for picture in range(round((hand.times[-1] / SECOND + AFTER) * RATE)):
        row = system.run(1.0 / RATE)[-1]
        for name, place in places.items():
            place.append(tuple(row.position) if name == HANDLE else method.pose(name))
        force.append(row.force_on_handle[:2])
        coupled.append(not int(row.withheld) & NOT_HELD)
        contacts += [(picture, *touch.point, *touch.force_on_a) for touch in method.contacts()]
    return {name: np.array(place) for name, place in places.items()}, np.array(force), np.array(coupled), contacts


def _hand(scene: Scene) -> PlayedTarget:
    """The hand's target along the way."""
    drawing = drawing_of(scene)
    way = np.array(drawing.way, float)
    lengths = np.linalg.norm(np.diff(way, axis=0) * (1.0, 1.0, ARM), axis=1)
    share = np.concatenate([[0.0], np.cumsum(lengths)]) / (lengths.sum() or 1.0)
    times = np.concatenate([[0.0], BEFORE + drawing.seconds * share])
    times, points = np.append(times, BEFORE + drawing.seconds), np.vstack([way[:1], way, way[-1:]])
    return PlayedTarget(np.round(times * SECOND).astype(np.int64), points)


def _system(scene: Scene, hand: PlayedTarget) -> tuple[Lockstep, World]:
    """The display of the demo's operating point, and its world."""
    given = read_operating_point(find("", "demo"), NODES)
    driver, loopback, values = (
        defaults(NODES[f"haptic_{name}"]) | given[f"haptic_{name}"] for name in ("driver", "loopback", "simulation")
    )
    simulation = Simulation.by_parameters(reduce_scene(scene, values["method"]), values)
    return Lockstep(load_device(driver["device"]), driver, loopback, simulation, hand=hand), simulation.method
