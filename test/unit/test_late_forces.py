# SPDX-License-Identifier: Apache-2.0
"""Whoever knows that forces act late, or changes settings while stretched, draws no more than the budget."""

import math

import numpy as np
import pytest
from examples import few, searching, tries
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import device, values

from adversary import exchange_search as adversary
from adversary.late_cases import BUDGET, CASES, drawn, settings_of
from adversary.late_forces import most_given
from adversary.tool_samples import AGE, DEVICE, MOVED, VELOCITY
from haptic_device.control import gain_check
from haptic_device.device import operator_hand
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import Lockstep
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

METHODS = "pspm", "local", "direct"
CASE = {case.name: case for case in CASES}


def untold(settings):
    """The same for a driver that knows of no delay."""
    settings["hardware"]["delay"] = 0.0
    return gain_check.counted(settings, 0.0)


@few(40)
@given(
    forces=st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=5),
    cuts=st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4),
    ways=st.lists(st.floats(-1e-3, 1e-3), min_size=5, max_size=5),
)
def test_no_path_of_the_same_way_is_given_more_by_forces_that_change_within_a_hold(forces, cuts, ways):
    """In SI units, T = 1 ms, b = 2; the best path goes τ_j (Δx/T + (f_j − F̄)/2b) under each force."""
    acts = np.array([0.0, *sorted(cuts[: len(forces) - 1])])
    times, force, way = 1e-3 * np.diff([*acts, 1.0]), np.array(forces), np.array(ways[: len(forces)])
    way[times < 1e-9] = 0.0
    times = np.maximum(times, 1e-30)
    best = times * (way.sum() / 1e-3 + (force - force @ times / 1e-3) / 4.0)
    bound = most_given(acts + 7.0, force, len(force), 7, 1e-3, way.sum(), 2.0)
    assert force @ best - 2.0 * (best**2 / times).sum() == pytest.approx(bound, abs=1e-9)
    assert force @ way - 2.0 * (way**2 / times).sum() <= bound + 1e-9


TRIED = [
    (method, case) for k, case in enumerate(CASES) for method in METHODS if searching() or method == METHODS[k % 3]
]


@pytest.mark.parametrize("method, case", TRIED, ids=[f"{method}, {case.name}" for method, case in TRIED])
def test_no_late_forces_messages_orders_or_changes_of_settings_are_found_that_draw_energy(method, case):
    """Each case against one method; with random draws against all."""
    assert drawn(method, case, tries(600), seed=CASES.index(case)) <= adversary.SURE


@pytest.mark.parametrize("method, name", [("pspm", "500 µs late"), ("local", "500 µs late")])
def test_the_same_search_draws_many_budgets_from_a_driver_that_is_not_told_of_the_delay(method, name):
    settings = untold(settings_of(method, CASE[name]))
    found = adversary.search(settings, CASE[name].against._replace(books=1, full=1), 30, 4000, 1)
    assert found.overcredit > 20.0 * BUDGET


def passive_hand(damping, told=True):
    """A hand of 0.3 kg on 8 kN/m shakes by ±15 N with a free tool of 0.1 kg, K = 1000, B = 0, 1 kHz, 1 ms late; no
    loss, no delay of the network. The system, and the most energy [J] that the plant gave it in 2 s at 40 Hz.
    """
    scene = load("free_space")
    scene = scene.model_copy(update={"tool": scene.tool.model_copy(update={"mass": 0.1})})
    gains = {"coupling__stiffness": 1000.0, "coupling__damping": 0.0, "engage__time": 0.05, "servo__rate": 1000.0}
    hand = {"hand__mass": 0.3, "hand__stiffness": 8000.0, "hand__damping": 0.0}
    system = Lockstep(
        device(damping, axes=1, actuation_delay=1e-3, sensing_delay=0.0),
        values("haptic_driver", exchange__method="pspm", exchange__rate=1000.0, **gains),
        values("haptic_loopback", **hand),
        Simulation(reduce_scene(scene), max_catch_up=0.2, port=port_of("pspm")),
    )
    system.settings = system.settings if told else untold(system.settings)
    system.motion["kind"], system.motion["lag"], most = operator_hand.FOLLOW, 1e-6, 0.0
    for k in range(2000):
        system.motion["points"][0, 0, 0] = 15.0 / 8000.0 * math.sin(2.0 * math.pi * 40.0 * k * 1e-3)
        system.run(1e-3)
        most = max(most, float(system.plant_memory["energy_given"][0]))
    return system, most


def test_a_passive_hand_that_shakes_a_late_device_is_given_no_more_than_the_budget_and_many_where_nobody_tells_it():
    system, given = passive_hand(1.58)
    assert gain_check.refusal(system.settings[0], 1e-3) == ""
    assert given <= system.settings["exchange"]["budget"][0]
    untold_of_it, given = passive_hand(1.4, told=False)
    assert given > 20.0 * system.settings["exchange"]["budget"][0]
    assert "needs b > 1.5 " in gain_check.refusal(untold_of_it.settings[0], 1e-3)


def credited(method, case, path, **more):
    """Most [J] that the books of a full tank are above the truth on this path {gene: values from tick 0 on}, in which
    MOVED is in metres and samples come at tick 0 only, if not said otherwise."""
    settings = settings_of(method, case)
    against = case.against._replace(full=1, **{"loss": 5.0} | more)
    genes, scale = np.zeros((max(map(len, path.values())), adversary.LATE_GENES)), adversary.scale_of(settings)
    for gene, numbers in path.items():
        genes[: len(numbers), gene] = numbers
    genes[:, MOVED] /= scale[MOVED]
    watched = np.full(4, -np.inf)
    tank = float(settings["exchange"]["tank"][0])
    adversary.energy_given(settings, *adversary.engaged(tank), genes, scale, against, watched)
    return watched[2]


STRETCHED = [*[-1e-4] * 100, 1.7e-3]  # [m] by 10 mm; then, in the tick of a cut, with the old force
STILL = [0.0] * 100
SPENT = {
    "cut in one tick by a sample that is too old": ("1 T late", -5.0, {AGE: [*STILL, 3.0, 3.0, 3.0]}),
    "clutch opened": ("clutch, enable", -5.0, {adversary.ORDERS: [*STILL, 2.0, 2.0, 2.0]}),
    "disabled": ("clutch, enable", -5.0, {adversary.ORDERS: [*STILL, -2.0, -2.0, -2.0]}),
    "moved fast, then back and forth within a long hold": (
        "missed ticks",
        5.0,
        {MOVED: [*[-5e-4] * 8, 2e-3, -1e-3, 1e-3, -1e-3, 0.0, 0.0], DEVICE: [*[0.0] * 10, *[2.0] * 3]},
    ),
    "led to a tool said to be far off, against its pull": (
        "1 T late",
        -5.0,
        {MOVED: [0.0, -3e-5, -5e-5, -4e-5, 0.0], VELOCITY: [3.0] * 5, AGE: [0.5] * 5},
    ),
}


@pytest.mark.parametrize("how", SPENT)
@pytest.mark.parametrize("method", METHODS)
def test_whatever_ends_a_pull_pays_for_the_force_that_still_acts(method, how):
    name, loss, path = SPENT[how]
    assert credited(method, CASE[name], {MOVED: STRETCHED} | path, loss=loss) <= adversary.SURE


@pytest.mark.parametrize(("depth", "way"), [(6e-3, 1e-3), (10e-3, 3e-3)])
@pytest.mark.parametrize("control", [False, True])
def test_a_wall_on_its_way_is_never_stiff_and_damped_beyond_what_either_of_its_settings_needs(control, depth, way):
    """Deep in it, where it stiffens slowly, by a handle that alternates from tick to tick."""
    case = CASE["live walls, on time"]
    case = case._replace(points=tuple(one | {"passivity.control": control} for one in case.points))
    there = [0.0, 0.0, *[-depth / 100.0] * 100, *(way * (-1.0) ** np.arange(158))]
    assert credited("pspm", case, {MOVED: there, adversary.POINT: [0.0, *[1.0] * 109]}) <= adversary.SURE
