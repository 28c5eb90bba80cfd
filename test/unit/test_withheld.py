# SPDX-License-Identifier: Apache-2.0
"""Every cause that keeps force back has its bit in the tick, and its word once it has lasted."""

import numpy as np
import pytest
from fault_table import FREE, WALL, Servo, pressing
from led import Led
from lockstep_systems import wall_system

from haptic_device.control import enable_state, withheld
from haptic_device.control.withheld import BREAK, LASTS, WithheldTime

BITS = {cause.name: cause.bit for cause in withheld.TABLE}


def names(row):
    return {name for name, bit in BITS.items() if int(row.withheld) & bit}


def coupled(**given):
    """A servo coupled to a tool at the origin."""
    runner = Servo(coupling__stiffness=500.0, engage__time=0.05, **given)
    runner.tool((0.0, 0.0, 0.0))
    runner.run(0.3)
    return runner


def test_what_is_commanded_decides_what_is_told_and_a_servo_that_gives_all_it_is_asked_for_tells_nothing():
    assert len(BITS) == len(withheld.TABLE) and np.bitwise_or.reduce([*BITS.values()]) == sum(BITS.values())
    assert names(coupled().move((0.001, 0.0, 0.0))) == names(Servo(**WALL, **FREE).move((-0.002, 0.0, 0.0))) == set()
    assert names(coupled().tick(command=enable_state.ENABLE | enable_state.CLUTCH)) == {"clutch"}
    assert names(Servo(coupling__stiffness=500.0).tick()) == {"no_tool"}
    for command in (0, enable_state.ENABLE | enable_state.ESTOP):
        assert names(coupled().tick(command=command, tool_age=-1.0)) == set()


def test_a_tool_sample_just_beyond_its_hold_is_told_and_one_just_within_is_not():
    runner = coupled()
    hold = float(runner.settings["exchange"]["hold"][0])
    assert names(runner.tick(tool_age=hold - 1e-6)) == set()
    assert names(runner.tick(tool_age=hold + 1e-3)) == {"old_tool"}
    assert names(runner.tick(tool_age=1e-3)) == {"old_tool"}  # until the coupling is whole again
    assert names(runner.run(0.01)) == set()


@pytest.mark.parametrize(("stretch", "told"), [(0.00199, set()), (0.00201, {"far_tool"})])
def test_a_tool_that_comes_too_far_away_for_a_small_force_is_told_and_a_nearer_one_is_coupled(stretch, told):
    runner = Servo(coupling__stiffness=500.0, engage__time=0.05)
    runner.move((stretch, 0.0, 0.0))
    runner.tool((0.0, 0.0, 0.0))
    row = runner.run(0.5)
    assert names(row) == told and (row.exchange_fade == 1.0) == (told == set())
    runner.move((0.0, 0.0, 0.0), 0.01)
    assert names(runner.run(0.5)) == set()


@pytest.mark.parametrize(("wanted", "told"), [(0.999, set()), (1.001, {"waiting"})])
def test_waiting_for_a_small_force_is_told_until_it_is_small(wanted, told):
    runner = Servo(settled=False, coupling__stiffness=1000.0, exchange__fade=0.001, engage__time=0.01)
    runner.command = 0
    runner.tool((wanted / 1000.0, 0.0, 0.0))
    runner.run(0.05)
    runner.command = enable_state.ENABLE
    assert names(runner.run(0.1)) == told
    runner.tool((0.0, 0.0, 0.0))
    assert names(runner.run(0.1)) == set()


@pytest.mark.parametrize(("depth", "told"), [(0.00199, set()), (0.00201, {"limit"})])
def test_a_force_at_its_limit_is_told_of_a_wall_and_of_a_coupling(depth, told):
    assert names(Servo(**WALL, **FREE, force__limit=2.0).move((-depth, 0.0, 0.0))) == told
    assert names(coupled(force__limit=1.0).move((depth, 0.0, 0.0))) == told


def test_new_settings_that_are_not_all_in_force_and_walls_that_have_let_go_are_told():
    runner = pressing()
    runner.settings["wall"]["offset"][0, 0] = 0.01  # nearer: paid along the way
    assert names(runner.tick()) == {"change"}
    runner = pressing()
    runner.memory["account"]["free"] = -1e-3  # of 2 mJ in the wall
    row = runner.run(0.01)
    assert names(row) == {"released_walls"} and abs(row.force_on_handle[0]) < 1.1
    assert names(runner.move((0.001, 0.0, 0.0))) == set(), "the handle is off them"


def test_forces_that_rise_into_a_wall_without_energy_to_pay_for_it_are_told():
    runner = Servo(**WALL, **FREE, exchange__budget=0.0, settled=False)
    runner.command = 0
    runner.run(0.05)
    runner.position[:] = (-0.0009, 0.0, 0.0)  # .9 N: small enough to begin with
    runner.memory["motion"]["device_position"] = runner.position
    runner.command = enable_state.ENABLE
    row = runner.run(0.6)
    assert names(row) == {"unpaid_rise"} and abs(row.force_on_handle[0]) < 0.5
    runner.move((0.001, 0.0, 0.0))
    assert names(runner.run(0.6)) == set()


def pulled(method, **given):
    """A handle on one axis with a tool that stands at the origin; the coupling by this method."""
    gains = {"coupling__stiffness": 1000.0, "coupling__damping": 0.25, "exchange__method": method, "wall__normals": ()}
    gains |= {f"wall__{name}": () for name in ("offsets", "stiffness", "damping")} | {"passivity__control": False}
    led = Led(wall_system(0.0, 0.0, axes=1, counts=1e9, **gains | given).settings, tool=(0.0,), ticks=1000)
    return led, lambda: led.row[0]


@pytest.mark.parametrize("method", ["pspm", "local", "direct"])
def test_a_coupling_that_the_account_keeps_short_is_told_and_one_that_it_pays_for_is_not(method):
    led, row = pulled(method)
    assert names(row()) == set()
    led.tool = (0.02,)
    led.follow([(0.0,)] * 300)  # the tool goes off, and the hand holds still: nobody pays
    assert names(row()) == {"tank"} and abs(row().force_coupling[0]) < 0.5 * 1000.0 * 0.02
    led.tool = (0.0,)
    led.follow([(0.0,)] * 300)
    assert names(row()) == set()


def test_a_damper_that_the_account_does_not_pay_for_is_told():
    led, row = pulled("pspm", exchange__budget=0.0, coupling__stiffness=0.0, coupling__damping=0.8)
    for k in range(4):  # the hand holds still, which pays nothing
        led.tool = (1e-4 * k,)
        led.go((0.0,), tool_velocity=(0.4, 0.0, 0.0))
    assert names(row()) == {"tank"}


def filled(parts):
    """WithheldTime after these (bits, seconds) at 1 kHz, given in blocks of 37 ticks."""
    bits = np.concatenate([np.full(round(seconds * 1000), bit, float) for bit, seconds in parts])
    times, kept = 1e12 + np.arange(len(bits)) * 1e6, WithheldTime()
    for at in range(0, len(bits), 37):
        kept.add(times[at : at + 37], bits[at : at + 37])
    return kept


def test_a_cause_stands_once_it_has_lasted_over_short_breaks_and_not_over_long_ones():
    half, tank = LASTS / 2 + 0.01, withheld.TANK
    assert filled([(0, 0.1), (tank, LASTS)]).standing() == {}
    stands = filled([(0, 0.1), (tank, LASTS + 0.002), (0, BREAK)])
    assert stands.standing() == {"tank": pytest.approx(LASTS + 0.001)}
    short = filled([(tank, half), (0, BREAK), (tank, half)])
    assert short.standing() == {"tank": pytest.approx(2 * half + BREAK - 0.001)}
    assert filled([(tank, half), (0, BREAK + 0.002), (tank, half)]).standing() == {}
    over = filled([(tank, 0.5), (0, BREAK + 0.002)])
    assert over.standing() == {} and over.totals() == {"tank": (pytest.approx(0.499), pytest.approx(0.499))}
