# SPDX-License-Identifier: Apache-2.0
"""Samples whose times have an error: what the hand is given by the truth, whatever their stamps say within it."""

import numpy as np
import pytest
from examples import tries
from exchange_systems import one_axis
from fault_table import PERIOD, Servo
from lockstep_systems import device, values, wall_system
from ticks import tick

from adversary import exchange_search as adversary
from haptic_device.control import (
    bumpless_transfer,
    controller_config,
    enable_state,
    faults,
    gain_check,
    velocity_estimator,
)

SPEED, COUNTS, BUDGET = 0.3, 1e9, 0.005  # [m/s], [1/m], [J]
GAINS = [(1000.0, 100.0, 2.6, 3.0), (1000.0, 50.0, 4.6, 5.0), (1000.0, 400.0, 2.0, 3.0), (4000.0, 2000.0, 2.0, 3.0)]


class Led:
    """A handle that goes straight from deadline to deadline, beside a tool at rest at 0; K, B, b in SI units.

    told: the error that the device tells with its samples, in periods; counted: whether the driver counts with it.
    """

    def __init__(self, rate, stiffness, damping, physical, told, method="pspm", counted=True, axes=1, **driver):
        self.period, self.physical, self.told = 1.0 / rate, physical, told
        body = device(physical, COUNTS, axes=axes, stamp_error=told / rate if counted else 0.0)
        gains = {"coupling__stiffness": stiffness, "coupling__damping": damping, "servo__rate": rate}
        driver = values("haptic_driver", **{"exchange__method": method} | gains | driver)
        self.settings = controller_config.settings_from(body, driver)
        (self.memory, self.row), self.place, self.ticks = adversary.engaged(), 0.0, 0
        self.given = self.most = 0.0
        self.go(0.0, 0.0)

    def go(self, way, shift):
        """The next deadline, a way [m] from the last, with a stamp that is `shift` periods wrong; the motor's force."""
        record, self.ticks = self.row[0], self.ticks + 1
        held = float(record["force_on_handle"][0])
        self.given += held * way - self.physical * way * way / self.period
        self.most, self.place = max(self.most, self.given), self.place + way
        record["deadline"] = 1e12 + self.ticks * self.period * 1e9
        record["latched"] = record["deadline"] + shift * self.period * 1e9
        record["stamp_error"] = self.told * self.period * 1e9
        record["command"], record["device_status"] = enable_state.ENABLE, faults.FRESH
        record["counts"][0] = np.round(self.place * COUNTS)
        record["tool_session"], record["tool_age"] = 1.0, self.period
        record["tool_sequence"] = record["tool_answered"] = self.ticks
        tick(self.settings, self.memory, self.row)
        assert record["fault"] == faults.NONE
        return float(record["force_on_handle"][0])

    def zigzag(self, shift, seconds=2.0):
        """At half of the servo's rate, with the stamps alternately early and late."""
        for _ in range(round(seconds / self.period) // 2):
            self.go(SPEED * self.period, shift)
            self.go(-SPEED * self.period, -shift)
        return self


@pytest.mark.parametrize("error", [0.0, 0.25, 0.4])
@pytest.mark.parametrize("gains", GAINS)
def test_a_zigzag_with_stamps_alternately_wrong_draws_nothing_from_a_display_that_knows_their_error(gains, error):
    for shift in (error, -error):
        led = Led(*gains, told=error).zigzag(shift)
        assert led.most <= BUDGET and led.given < 0.0
        assert led.row["energy_given"][0, 0] >= led.given - 1e-9  # as the servo counts it, never less than the truth


@pytest.mark.parametrize("share, draws", [(0.97, False), (1.03, True)])
def test_a_damper_of_believed_times_acts_as_one_of_b_over_1_less_four_times_the_squared_error(share, draws):
    """Half of the velocities are over T − 2u and half over T + 2u: B/2 (T/(T − 2u) + T/(T + 2u))."""
    error, physical = 0.25, 3.0
    damping = share * physical * (1.0 - 4.0 * error**2)
    apart = {"method": "direct", "passivity__control": False, "passivity__policy": "off", "cancellation__ratio": 0.0}
    hidden, told = (Led(1000.0, 0.01, damping, physical, told, **apart) for told in (0.0, error))
    assert (hidden.zigzag(error).given > 0.0) == draws and told.zigzag(error).given < 0.0


@pytest.mark.parametrize("seed", range(tries(30)))
def test_no_hand_that_follows_the_force_is_given_more_than_the_budget_whatever_the_stamps_say(seed):
    random = np.random.default_rng(seed)
    error = random.choice([0.05, 0.1, 0.25, 0.4])
    rate, method = random.choice([1000.0, 4000.0]), random.choice(["pspm", "local"])
    physical, damping = 3.0, random.uniform(0.0, 2.0)
    estimator = random.choice(["backward_difference", "lowpass", "adaptive_window"])
    driver = {"method": method, "velocity__estimator": estimator, "velocity__lag": 1e-3}
    stiffness = 50.0
    while stiffness < 5000.0:  # as stiff as the driver takes with that error
        led = Led(rate, 1.5 * stiffness, damping, physical, error, **driver)
        if gain_check.margins(led.settings[0], gain_check.delays(led.settings[0]))[1] <= 0.0:
            break
        stiffness *= 1.5
    led, way, force = Led(rate, stiffness, damping, physical, error, **driver), 0.0, 0.0
    wide, follows = int(2.0 ** random.uniform(0.0, 5.0)), random.random()
    shifts = random.uniform(-error, error, 2000) if random.random() < 0.5 else random.choice([-error, error], 2000)
    for k, shift in enumerate(shifts):
        way = way if k % wide else random.normal() * SPEED / rate
        step = abs(way) * np.sign(force) if random.random() < follows else way
        force = led.go(step if abs(led.place + step) < 0.05 else -0.5 * led.place, shift)
    assert led.most <= BUDGET


@pytest.mark.parametrize("error, fits", [(0.0, True), (1e-4, False)])
def test_gains_are_judged_with_the_error_that_a_description_tells_as_with_a_delay(error, fits):
    settings = one_axis("pspm", 1000.0, 0.25, 1e-3, over=1.05)
    settings["hardware"]["stamp_error"] = error
    assert (gain_check.refusal(settings[0], gain_check.delays(settings[0])) == "") == fits


@pytest.mark.parametrize("error, fault", [(0.0, faults.ENCODER_JUMP), (0.1, faults.VELOCITY), (0.2, faults.NONE)])
def test_a_short_time_that_may_be_a_longer_one_is_no_jump_and_no_speed(error, fault):
    """A way at 0.4 of the limit over a period, in a tenth of one by the stamps: 4, 4/3 and 0.8 of the limit."""
    runner = Servo()
    told = {"stamp_error": error * PERIOD * 1e9}
    runner.tick(**told)
    runner.position[0] += 0.4 * float(runner.settings["hardware"]["velocity_limit"][0, 0]) * PERIOD
    assert runner.tick(latched=runner.now + 0.1 * PERIOD * 1e9, **told).fault == fault


def test_windows_of_the_estimator_last_as_long_as_their_ends_allow():
    times, places = np.zeros(64), np.zeros(64)
    times[:4], places[:4] = np.arange(4) * 1e-3, np.arange(4) * 1e-3
    for error, velocity in ((0.0, 1.0), (0.5e-3, 0.75)):
        found = velocity_estimator.adaptive_velocity(times, np.full(64, error), places, 3, 4, 16, 1e-9)
        assert found == pytest.approx(velocity)


def test_an_error_that_only_the_description_tells_counts_in_each_tick():
    system = wall_system(500.0, 0.0)
    system.settings["hardware"]["stamp_error"] = 1e-4
    assert (system.run(0.01).stamp_error == 1e5).all()


@pytest.mark.parametrize("axes, offset", [(1, 0.0), (2, 0.0), (1, -0.1)])  # in the wall, beside a still axis, off it
def test_a_tank_in_debt_holds_the_dampers_of_coupling_and_walls_until_it_is_paid(axes, offset):
    wall = {"wall__offsets": (offset,), "wall__stiffness": (100.0,), "wall__damping": (0.5,)}
    led = Led(1000.0, 100.0, 1.0, 3.0, 0.0, axes=axes, wall__normals=(1.0, 0.0), **wall)
    now = led.memory["in_force"][0]
    led.go(-1e-3, 0.0)
    assert (now["coupling"]["damping"][0], now["wall"]["damping"][0]) == (1.0, 0.5)
    led.memory["tank"]["level"] = -1e-3
    led.go(0.0, 0.0)
    assert (now["coupling"]["damping"][0], now["wall"]["damping"][0]) == (0.0, 0.0)
    assert led.memory["change"]["going"][0] >= bumpless_transfer.OTHERS
    for k in range(3000):  # the hand fills the tank
        led.go(3e-4 * (-1) ** (k // 8), 0.0)
    assert led.memory["tank"]["level"][0] >= 0.0
    assert (now["coupling"]["damping"][0], now["wall"]["damping"][0]) == (1.0, 0.5)
