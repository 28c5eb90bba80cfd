# SPDX-License-Identifier: Apache-2.0
"""A wall pressed over each kind of link, in made-up time: whatever is late, lost or ends, the motor is zero in time,
and no hand gets energy beyond the budget, by the plant's truth. The descriptions are true of what is behind them.
"""

import functools
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from lockstep_link import BRIDGE, DEVICE, LOOK, MS, SERVO, Arms, Knob, Link, Reference, Way
from lockstep_systems import values

from haptic_device.control import enable_state, faults
from haptic_device.link import codec
from haptic_device.nodes.bridge import clock_trouble
from haptic_device.nodes.fault_detail import LatchedFault
from haptic_device.realtime.hardware_interface import SharedMemoryInterface

BUDGET = values("haptic_driver")["exchange.budget"]  # [J] of the one account
WATCHDOG, FREE_LOOK = 15 * MS, MS  # [ns] of the bridge, and its looks at a servo that is silent
LATE_FAULTS = {faults.NONE, faults.DEVICE_SILENT, faults.DEVICE_WATCHDOG}


class Case(NamedTuple):
    """make: the mechanism; wall: its place [m] and stiffness [N/m]; longest: way on the line [ns]; late: of a force
    then [s]; own_watchdog: of the device [ns], None if it has none; loss: share of samples lost.
    """

    make: object
    wall: tuple
    longest: int
    late: float
    own_watchdog: int | None
    loss: float = 0.0


CASES = {
    "knob": Case(functools.partial(Knob, 0.02), (0.0, 200.0), 2 * MS, 0.008, 100 * MS),
    "two joints": Case(functools.partial(Arms, 0.02), (0.0, 4.0), 600_000, 0.003, None),
    "datagrams": Case(functools.partial(Reference, True, 0.02), (0.0, 200.0), 450_000, 0.002, 15 * MS, 0.05),
    "serial": Case(functools.partial(Reference, False, 0.02), (0.0, 200.0), 450_000, 0.002, 15 * MS),
}
each = pytest.mark.parametrize("name", CASES)
watched = pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.own_watchdog])


def linked(name, seed=0, **given):
    """A link of this kind, whose hand is not in the wall yet; `case`: what it is."""
    case = CASES[name]
    where, stiffness = case.wall
    free = {f"coupling__{name}": 0.0 for name in ("stiffness", "damping", "rotational_stiffness", "rotational_damping")}
    free |= {"engage__time": 0.02, "servo__rate": 1000.0}
    wall = {"wall__normals": (1.0, 0.0), "wall__offsets": (where,), "wall__stiffness": (stiffness,)}
    link = Link(case.make(), seed, late=case.late, wall__damping=(0.0,), **free | wall | given)
    link.case, link.push = case, 0.5 * stiffness * 0.01
    return link


def pressed(link, seconds=2.0):
    """The same, enabled, with the hand 10 mm and more in the wall and the motor against it."""
    if link.state != enable_state.ENGAGED:
        link.mechanism.hold(link.case.wall[0] + 0.01)
        link.enable()
    link.mechanism.hold(link.case.wall[0] - 0.02)
    link.until(lambda: link.mechanism.force > link.push, seconds)
    return link


def pressed_again(link):
    """The same after a fault: a person leads the handle off the wall, and resets until the cause is over."""
    link.mechanism.hold(link.case.wall[0] + 0.01)
    for _ in range(30):
        link.run(0.05)
        if link.state == enable_state.ENGAGED:
            return pressed(link)
        link.reset()
    raise AssertionError(f"fault {link.fault} stays")


def ways(name, seed, longest=None):
    """Ways of this seed, up to the longest at which a command is there before its deadline."""
    case, random = CASES[name], np.random.default_rng(seed)
    longest = longest or case.longest
    way = Way(int(random.uniform(0.01, 0.2) * longest), int(random.uniform(0.0, 0.3) * longest), longest)
    return {"way": way, "back": way._replace(loss=case.loss * random.random())}


def zero_at(link, within):
    """Goes on for so long [ns]; the motor is zero then, and stays so."""
    link.run(within * 1e-9)
    assert link.mechanism.force == 0.0
    link.run(0.05)
    assert link.mechanism.force == 0.0


@each
@pytest.mark.parametrize("seeds", [range(first, first + 10) for first in range(0, 40, 10)], ids=str)
def test_bytes_that_are_late_make_no_fault_and_no_debt_and_give_no_energy(name, seeds):
    for seed in seeds:
        link = pressed(linked(name, seed, **ways(name, seed)))
        link.mechanism.hold(link.case.wall[0] + 0.02)
        link.run(0.08)
        assert link.fault == faults.NONE
        assert link.trace().exchange_tank.min() >= 0.0
        assert link.most_given <= BUDGET
        link.end_servo(well=seed % 2 == 0)
        zero_at(link, WATCHDOG + FREE_LOOK + 3 * link.case.longest)
        link.close()


@each
@pytest.mark.parametrize("seeds", [range(first, first + 5) for first in range(0, 15, 5)], ids=str)
def test_whoever_sleeps_for_a_while_makes_no_fault_but_silence_and_all_works_again(name, seeds):
    for seed in seeds:
        random = np.random.default_rng(seed)
        link = pressed(linked(name, seed, way=Way(20_000, 100_000, MS)))
        for who in random.permutation([SERVO, BRIDGE, DEVICE])[: random.integers(1, 4)]:
            link.sleep(who, random.uniform(0.001, 0.08))
        link.run(0.2)
        assert set(link.trace().fault.astype(int)) <= LATE_FAULTS
        assert link.most_given <= BUDGET
        pressed_again(link)
        link.close()


@each
@pytest.mark.parametrize("well", [True, False])
def test_a_servo_that_ends_leaves_the_motor_at_zero_and_the_bridge_has_taken_it_back(name, well):
    link = pressed(linked(name))
    link.end_servo(well)
    zero_at(link, (0 if well else WATCHDOG) + FREE_LOOK + LOOK)
    assert name != "knob" or "1 11" not in link.mechanism.log.said("mode")  # its drive has not given up by itself


@each
def test_a_servo_that_is_stopped_pushes_nobody_when_it_goes_on(name):
    link = pressed(linked(name))
    link.sleep(SERVO, 0.1)
    zero_at(link, WATCHDOG + FREE_LOOK + LOOK)
    link.run(0.1)
    assert link.fault in LATE_FAULTS - {faults.NONE} and link.mechanism.force == 0.0


@each
def test_a_bridge_that_ends_well_says_zero_last(name):
    link = pressed(linked(name))
    link.end_bridge()
    zero_at(link, MS)
    link.run(0.05)
    assert link.fault == faults.DEVICE_SILENT


@watched
@pytest.mark.parametrize("seconds", [None, 0.3])
def test_a_bridge_that_is_killed_or_stopped_is_answered_by_the_devices_own_watchdog_and_by_a_silent_device(
    name, seconds
):
    link = pressed(linked(name))
    link.sleep(BRIDGE, *([seconds] if seconds else []))
    zero_at(link, link.case.own_watchdog + 2 * MS)
    assert link.fault == faults.DEVICE_SILENT
    link.run(0.3)  # one that was stopped speaks again
    assert link.mechanism.force == 0.0


@watched
def test_where_nothing_passes_the_device_cuts_by_itself_and_afterwards_all_works_again(name):
    link = pressed(linked(name))
    link.passing = False
    zero_at(link, link.case.own_watchdog + 2 * MS)
    assert link.fault == faults.DEVICE_SILENT
    link.mechanism.hold(link.case.wall[0] + 0.01)
    link.run(0.3)
    link.passing = True
    link.run(0.3)
    assert link.mechanism.force == 0.0
    pressed_again(link)


@pytest.mark.parametrize("name", ["datagrams", "serial"])
@pytest.mark.parametrize(("cut", "said"), [(0, "to the device for 0.015 s"), (1, "from the device for 0.0")])
def test_a_line_that_is_cut_one_way_is_named_by_the_end_that_hears_nothing(name, cut, said):
    link = pressed(linked(name))
    link.ways = tuple(Way(loss=float(way == cut)) for way in (0, 1))
    zero_at(link, link.case.own_watchdog + 7 * MS)
    latched = LatchedFault(name, SharedMemoryInterface.watchdog.__get__(SimpleNamespace(memory=link.words)))
    latched.add(link.trace(), link.settings[0])
    assert link.fault == (faults.DEVICE_WATCHDOG, faults.DEVICE_SILENT)[cut]
    assert f"over the line {said}" in latched.sentence(link.fault)
    link.close()


@pytest.mark.parametrize("name", ["datagrams", "serial"])
def test_the_button_of_the_device_is_a_fault_that_no_reset_clears_while_it_is_pressed(name):
    link = pressed(linked(name))
    link.mechanism.input(faults.BUTTON)
    zero_at(link, 2 * MS)
    link.reset()
    link.run(0.01)
    assert link.fault == faults.DEVICE_ESTOP
    link.mechanism.input(0)
    pressed_again(link)


# ---- clocks that are not what they should be ----


def led(link, seconds=0.2):
    """The hand leads the handle there and back; returns how often too fast the fastest velocity was read."""
    link.until(lambda: link.rows)
    link.run(0.3)
    first, fastest = len(link.rows), 0.0
    for i in range(round(1000 * seconds)):
        if i % 100 == 0:
            link.mechanism.hold(0.05 if i % 200 else -0.05)
        link.run(1e-3)
        fastest = max(fastest, abs(link.mechanism.speed))
    assert fastest > 0.2
    return np.abs(link.trace(first).velocity[:, 0]).max() / fastest


@pytest.mark.parametrize("name", ["datagrams", "serial"])
@pytest.mark.parametrize("skew", [500e-6, -500e-6, 1e-3, -1e-3])
def test_a_clock_within_a_thousandth_tells_a_hand_as_fast_as_it_is(name, skew):
    link = linked(name, way=Way(20_000, 50_000, 200_000))
    link.mechanism.skew = skew
    assert 0.8 < led(link) < 1.01  # over the longest time, which the clock's error makes longer
    assert link.fault == faults.NONE and clock_trouble(link.codec.state, link.now) == ""
    assert link.codec.state[codec.SKEW] * 1e-9 == pytest.approx(skew, abs=100e-6)


@pytest.mark.parametrize("name", ["datagrams", "serial"])
@pytest.mark.parametrize("skew, said", [(0.01, "1 % fast"), (-0.004, "0.4 % slow")])
def test_a_clock_that_drifts_more_is_a_fault_of_the_clock_and_told_with_its_drift(name, skew, said):
    link = linked(name)
    link.mechanism.skew = skew
    link.until(lambda: link.fault != faults.NONE)
    assert link.fault == faults.DEVICE_CLOCK
    link.run(1.0)
    assert clock_trouble(link.codec.state, link.now) == f"the device's clock is {said}; 0.1 % is followed"
    link.reset()
    link.run(0.01)
    assert link.fault == faults.DEVICE_CLOCK


@pytest.mark.parametrize("name", ["datagrams", "serial"])
@pytest.mark.parametrize("step", [300_000, -300_000, 5 * MS, -5 * MS, 60 * MS, -60 * MS, 1000 * MS, -1000 * MS])
def test_a_clock_that_is_set_is_a_fault_of_the_clock_and_told_and_all_works_again(name, step):
    link = pressed(linked(name))
    link.mechanism.ahead += step
    link.run(0.05)
    assert link.fault == faults.DEVICE_CLOCK and link.mechanism.force == 0.0
    link.run(0.2)
    told = f"the device's clock was set {'forward' if step > 0 else 'back'} by "
    told, _, said = clock_trouble(link.codec.state, link.now).partition(told)
    assert (told, said.split()[1:3]) == ("", ["ms;", "never"])
    assert float(said.split()[0]) == pytest.approx(abs(step) / MS, abs=0.05)
    assert link.codec.state[codec.CLOCK_STEPS] == 1
    pressed_again(link)
    assert link.most_given <= BUDGET


@pytest.mark.parametrize("name", ["datagrams", "serial"])
def test_answers_that_jitter_too_much_are_a_fault_of_the_clock_and_told(name):
    link = linked(name, way=Way(300_000, MS, 4 * MS))
    link.until(lambda: link.fault != faults.NONE)
    link.run(0.5)
    assert link.fault == faults.DEVICE_CLOCK
    assert "jitter" in clock_trouble(link.codec.state, link.now)


@pytest.mark.parametrize("name", ["datagrams", "serial"])
def test_commands_that_come_after_their_deadline_are_at_worst_a_fault_with_the_motor_at_zero(name):
    found = []
    for seed in range(12):
        link = linked(name, seed, **ways(name, seed, longest=2 * MS))
        link.mechanism.hold(link.case.wall[0] + 0.01)
        link.enable()
        link.mechanism.hold(link.case.wall[0] - 0.02)
        link.run(0.3)
        found.append(link.fault)
        assert link.most_given <= BUDGET
        assert link.fault == faults.NONE or link.mechanism.force == 0.0
        assert np.abs(link.trace().position).max() < 0.03
        link.close()
    assert set(found) <= {faults.NONE, faults.DEVICE_CLOCK}


def test_answers_that_take_from_one_to_four_periods_make_no_hand_faster_than_it_is():
    worst = 0.0
    for seed in range(5):
        link = linked("knob", seed, way=Way(100_000, 400_000, 2 * MS))
        link.until(lambda link=link: link.rows)
        link.mechanism.hold(-0.06)
        speed = 0.0
        for _ in range(60):
            link.run(1e-3)
            speed = max(speed, abs(link.mechanism.speed))
        worst = max(worst, np.abs(link.trace().velocity).max() / speed)
        link.close()
    assert worst < 1.01
