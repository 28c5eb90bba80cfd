# SPDX-License-Identifier: Apache-2.0
"""The passivity observer and controller of the servo."""

import numpy as np
import pytest
import stalling
from examples import few, half
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import wall_system
from ticks import tick

from adversary import exchange_search
from haptic_device.control import enable_state, faults, gain_check, passivity, virtual_coupling

TICK = 1 / 4000.0
ROUNDING = 1e-9  # [J] against stores of 10 to 100 mJ
COUNTS = 1e9  # per metre, of a handle whose steps are not the matter


@few(8)
@given(
    share=st.floats(0.05, 0.98),
    damping=st.floats(0.0, 0.5),
    angle=st.floats(0.0, 360.0),
    counts=st.sampled_from([1e7, 2e5, 2e4]),
)
def test_observer_finds_nothing_at_any_wall_within_the_margin(share, damping, angle, counts):
    stiffness = share * 2.0 * (1.0 - damping) / TICK
    system = wall_system(stiffness, damping, angle, counts=counts)
    assert gain_check.margins(system.settings[0], 0.0)[1] > 0.0
    rows = system.run(1.2)
    assert rows.generated.max() < ROUNDING + 0.02 * damping * (1.0 / counts) ** 2 / TICK * len(rows)
    assert rows.injections[-1] == 0


MOST = {"backward_difference": ROUNDING, "lowpass": 5e-6}  # [J] found with a velocity estimator


@half("motion, source, estimator", ["tap", "press_wall"], ["model", "measured"], list(MOST))
def test_observer_stays_silent_at_a_wall_within_the_margin_before_which_cancellation_fades(motion, source, estimator):
    cancelled = {"cancellation__ratio": 0.9, "cancellation__source": source, "coupling__rotational_damping": 0.0}
    for share, damping in ((0.98, 0.0), (0.95, 0.3)):
        stiffness = share * 2.0 * (1.0 - damping) / TICK
        system = wall_system(stiffness, damping, 35.0, motion, velocity__estimator=estimator, **cancelled)
        assert gain_check.margins(system.settings[0], 0.0)[1] > 0.0
        rows = system.run(1.2)
        assert np.any((rows.cancellation_fade > 0.0) & (rows.cancellation_fade < 1.0))
        assert rows.generated.max() < MOST[estimator]
        assert rows.injections[-1] == 0


def test_observer_finds_the_leak_of_a_wall_far_beyond_the_margin_and_the_controller_takes_it_back():
    wild = {"passivity__policy": "off", "physical_damping": 0.3, "counts": 2e4}
    loose = wall_system(30000.0, 0.0, passivity__control=False, **wild)
    held = wall_system(30000.0, 0.0, passivity__control=True, passivity__budget=1e-4, **wild)
    loose_rows, held_rows = loose.run(1.2), held.run(1.2)
    assert loose_rows.generated.max() > 1e-4
    assert loose_rows.injections[-1] == 0
    assert held_rows.injections[-1] > 0
    assert held_rows.injected[:, 1].max() == pytest.approx(wild["physical_damping"])  # and never more
    assert held_rows.generated[-1].max() < loose_rows.generated[-1].max()
    assert held.plant_memory["energy_given"][0] < loose.plant_memory["energy_given"][0]


def test_walls_let_go_of_what_missed_ticks_gave_and_then_the_hand_gets_nothing():
    """A wall of 0.95 of its bound; a hold of two periods is beyond."""
    given, rows = stalling.pressed("wall", 0.95, 0.05, 40)
    assert np.abs(rows.force_walls[:, 0]).max() > 1.5
    assert given <= 0.001  # passivity.budget
    assert stalling.pressed("wall", 0.95, 0.05, 40, control=False)[0] > 0.02


class Led:
    """A servo whose handle goes where it is told, x = −depth [m], in a hold of so many periods."""

    def __init__(self, stiffness, angle=0.0, **system):
        self.settings = wall_system(stiffness, 0.0, angle, counts=1e7, **system).settings
        (self.memory, self.row), self.time, self.depth, self.given = exchange_search.engaged(), 0.0, 0.0, 0.0

    def go(self, depth, periods=1.0, status=faults.FRESH, command=enable_state.ENABLE):
        """Force of the wall from then on [N]; given [J] goes on by the force that was held less what b surely took."""
        way = self.depth - depth
        lost = self.settings["hardware"]["damping"][0, 0] * way * way / (periods * TICK)
        self.given += float(self.row["force_on_handle"][0, 0]) * way - lost
        self.depth, self.time = depth, self.time + periods * TICK * 1e9
        self.row["latched"] = self.row["deadline"] = self.time
        self.row["command"], self.row["device_status"] = command, status
        self.row["counts"][0, 0] = -round(depth * 1e7)
        tick(self.settings, self.memory, self.row)
        return float(self.row["force_walls"][0, 0])


@pytest.mark.parametrize("axes, angle", [(2, 0.0), (1, 0.0), (1, 360.0)])  # sin 360° is not 0 by rounding
def test_a_wall_that_a_missed_tick_left_owing_is_weaker_by_that_energy_and_whole_again_once_left(axes, angle):
    stiffness, depth, step = 0.9 * 2.0 / TICK, 1e-3, 1e-4
    hand = Led(stiffness, angle, axes=axes, passivity__budget=1e-6)
    for k in range(11):
        assert hand.go(step * k) == pytest.approx(stiffness * step * k)
    assert (hand.row["generated"][0, 0], hand.row["injections"][0]) == (0.0, 0)
    made = 0.5 * stiffness * step**2 - step**2 / (3.0 * TICK)  # leak of the hold, less what the damper took for certain
    stored, owed = 0.5 * stiffness * (depth + step) ** 2, made - 1e-6
    weaker = stiffness * (depth + step) * (1.0 - owed / stored)
    assert hand.go(depth + step, 3.0) == pytest.approx(weaker, rel=1e-3)
    assert hand.row["generated"][0, 0] == pytest.approx(made, rel=1e-3)  # of the row before it was paid
    assert hand.row["injections"][0] == 1
    assert hand.go(depth + step) == pytest.approx(weaker, rel=1e-3)
    assert hand.go(-step) == 0.0
    assert hand.go(depth) == pytest.approx(stiffness * depth)


def test_walls_against_each_other_whose_sum_is_within_the_limit_owe_no_more_than_one_of_their_stiffness():
    """Two of 1000 N/m, 50 mm deep each: 50 N that leave 2000 N/m about the middle; a hold of 3 T at 0.5 m/s."""
    both = {"wall__normals": (1.0, 0.0, -1.0, 0.0), "wall__offsets": (0.05, 0.05)}
    hand = Led(0.0, **both, wall__stiffness=(1000.0, 1000.0), wall__damping=(0.0, 0.0))
    step, depth = 0.5 * TICK, 0.0
    for _ in range(16):
        depth += step
        assert hand.go(depth) == pytest.approx(2000.0 * depth, rel=1e-3)
    depth -= 3.0 * step
    assert hand.go(depth, 3.0) == pytest.approx(2000.0 * depth, rel=1e-3)
    leak = 0.5 * 2000.0 * (3.0 * step) ** 2 - (3.0 * step) ** 2 / (3.0 * TICK)
    assert hand.memory["observer"]["missed_tick_energy"][0] == pytest.approx(max(0.0, leak), abs=1e-7)
    assert hand.memory["walls"]["release"][0] == 0.0


def test_a_wall_left_from_the_motors_limit_in_one_long_hold_gives_that_once_and_is_not_there_until_it_is_paid():
    hand, given = Led(7000.0), []
    for _ in range(4):
        for depth in np.linspace(-1e-3, 3.4e-3, 200):
            hand.go(depth)
        hand.go(-1e-3, 40.0)
        given.append(hand.given)
    assert given[0] > 0.01 and max(given) == given[0]
    assert hand.memory["walls"]["release"][0] == 1.0 and hand.go(3e-3) == 0.0


def test_a_device_that_cut_its_motor_and_whoever_engages_anew_owe_nothing():
    hand = Led(7000.0)
    hand.go(1e-3)
    hand.go(8e-3, 800.0, faults.FRESH | faults.WATCHDOG)
    assert hand.row["fault"][0] == faults.DEVICE_WATCHDOG and hand.memory["observer"]["missed_tick_energy"][0] == 0.0
    other = Led(7000.0)
    other.go(1e-3)
    paid = 0.5 * 7000.0 * 1e-3**2 + 7.0 * 7e-3 + other.settings["passivity"]["budget"][0]  # and b took the rest
    weaker = 7000.0 * 8e-3 * (paid + 7e-3**2 / (40.0 * TICK)) / virtual_coupling.spring_store(7000.0, 15.0, 8e-3)
    assert other.go(8e-3, 40.0) == pytest.approx(weaker) and other.memory["walls"]["release"][0] > 0.0
    other.go(8e-3, command=0)
    assert other.go(8e-3, command=0) == pytest.approx(7000.0 * 8e-3) and other.row["engage"][0] == 0.0


class OldCounts:
    """A display whose tool says what is pulled with, and ticks that find no newer counts: there nobody sees the hand.

    given: energy [J] that the hand got from the forces that were held, less what the device's damper took.
    """

    def __init__(self, damping=1.0, stiffness=1000.0, **driver):
        direct = {"exchange__method": "direct", "coupling__stiffness": stiffness, "passivity__policy": "off", **driver}
        self.settings = wall_system(0.0, 0.0, 0.0, physical_damping=damping, counts=COUNTS, **direct).settings
        self.memory, self.row = exchange_search.engaged()
        self.damping, self.stiffness, self.time, self.place, self.given = damping, stiffness, 0.0, 0.0, 0.0
        self.tick(0.0, 1)

    def tick(self, force, periods, fresh=True):
        """The force [N] that is held from this tick on, which comes so many periods after the last one."""
        self.time += periods * TICK * 1e9
        self.row["deadline"], self.row["command"] = self.time, enable_state.ENABLE
        if fresh:
            self.row["latched"], self.row["counts"][0, 0] = self.time, round(self.place * COUNTS)
        self.row["tool_age"] = 0.001
        self.row["tool_position"][0, 0] = self.row["position"][0, 0] + force / self.stiffness
        tick(self.settings, self.memory, self.row)
        return float(self.row["force_on_handle"][0, 0])

    def hold(self, forces, periods, ways):
        """Forces held for so many periods each, all but the first on old counts; ways(forces, times) are the hand's.

        The forces as they were, and the way [m] from one sample to the next.
        """
        lengths = [1, *periods[:-1]]  # until each tick, since the one before
        held = np.array([self.tick(f, n, k == 0) for k, (f, n) in enumerate(zip(forces, lengths, strict=True))])
        times = TICK * np.array(periods)
        moved = ways(held, times)
        moved[-1] += round((self.place + moved.sum()) * COUNTS) / COUNTS - self.place - moved.sum()
        self.place += moved.sum()
        self.given += float(held @ moved - self.damping * np.sum(moved**2 / times))
        self.tick(forces[-1], periods[-1])
        return held, self.memory["motion"]["moved"][0, 0]

    def booked(self):
        return self.row["energy_given"][0, 0], self.row["generated"][0, 0]


def best_way(total, damping):
    """The way that gives the hand most: faster while it is pushed, by (f − mean f)/2b."""

    def ways(forces, times):
        mean = forces @ times / times.sum()
        return times * (total / times.sum() + (forces - mean) / (2.0 * damping))

    return ways


FORCES = st.lists(st.tuples(st.floats(-8.0, 8.0), st.integers(1, 3)), min_size=2, max_size=6)
WAYS = st.lists(st.floats(-2e-4, 2e-4), min_size=6, max_size=6)


@given(holds=FORCES, path=WAYS, damping=st.sampled_from([0.3, 1.0, 8.0]))
def test_whatever_the_force_does_over_old_counts_the_best_way_gives_what_is_booked_and_no_way_more(
    holds, path, damping
):
    display, other = OldCounts(damping), OldCounts(damping)
    forces, moved = display.hold(*zip(*holds, strict=True), best_way(path[0], damping))
    given, generated = display.booked()
    assert display.row["fault"][0] == faults.NONE
    assert given == pytest.approx(display.given, rel=1e-6, abs=1e-9)
    stored = 0.5 * display.stiffness * moved**2 - forces[-1] * moved  # by the spring, as it pulled last
    assert generated == pytest.approx(max(0.0, display.given + stored), rel=1e-6, abs=1e-9)
    other.hold(*zip(*holds, strict=True), lambda forces, times: np.array(path[: len(forces)]))
    assert other.booked()[0] >= other.given - 1e-12


def test_a_force_that_changes_gives_no_more_than_its_way_at_the_speed_limit_however_little_damping_there_is():
    """±8 N over two periods, at 10 m/s at most; by damping alone it would be 0.8 J."""
    display = OldCounts(0.01)
    display.hold((8.0, -8.0), (1, 1), lambda forces, times: np.zeros(2))
    given, generated = display.booked()
    assert 0.0 < given <= 8.0 * 10.0 * 2.0 * TICK + ROUNDING and generated <= given + ROUNDING


@given(
    stiffness=st.floats(0.0, 1e5),
    share=st.floats(0.0, 1.0),
    path=st.lists(st.floats(-1e-3, 1e-3), min_size=3, max_size=40),
)
def test_a_held_spring_within_its_damping_generates_nothing_whatever_the_path(stiffness, share, path):
    damping = share * 2.0
    physical = stiffness * TICK / 2.0 + damping
    x, store, total, held = 0.0, 0.0, 0.0, 0.0
    previous = 0.0
    for moved in path:
        growth = 0.5 * stiffness * ((x + moved) ** 2 - x**2)
        made = passivity.energy_generated(held, moved, growth, physical, TICK)
        now = passivity.damping_store(damping, moved, TICK)
        total, store, x, previous = total + made + now - store, now, x + moved, moved
        held = -stiffness * x - damping * previous / TICK
        assert total <= 1e-12 * (1.0 + stiffness)


def test_booked_energy_follows_the_truth_of_a_press():
    system = wall_system(3000.0, 0.2, motion="press_wall")
    rows = system.run(1.2)
    truth = system.plant_memory["energy_given"][0]
    assert rows.energy_given[-1].sum() == pytest.approx(truth, rel=0.02)
    assert np.all(rows.fault == 0)
