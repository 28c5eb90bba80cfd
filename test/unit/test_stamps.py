# SPDX-License-Identifier: Apache-2.0
"""Samples whose times have an error: what the hand is given by the truth, whatever their stamps say within it."""

import numpy as np
import pytest
from examples import tries
from fault_table import PERIOD, Servo
from led import Led
from lockstep_systems import device, values, wall_system

from haptic_device.control import controller_config, faults, gain_check, velocity_estimator

SPEED, COUNTS, BUDGET = 0.3, 1e9, 0.005  # [m/s], [1/m], [J]
GAINS = [(1000.0, 100.0, 2.6, 3.0), (1000.0, 50.0, 4.6, 5.0), (1000.0, 400.0, 2.0, 3.0), (4000.0, 2000.0, 2.0, 3.0)]


class Stamped(Led):
    """A handle that goes straight from deadline to deadline, beside a tool at rest at 0; K, B, b in SI units.

    told: the error that the device tells with its samples, in periods; counted: whether the driver counts with it.
    """

    def __init__(self, rate, stiffness, damping, physical, told, method="pspm", counted=True, axes=1, **driver):
        self.told = told
        body = device(physical, COUNTS, axes=axes, stamp_error=told / rate if counted else 0.0)
        gains = {"coupling__stiffness": stiffness, "coupling__damping": damping, "servo__rate": rate}
        gains |= {"engage__time": 1.0 / rate, "exchange__fade": 1.0 / rate}
        driver = values("haptic_driver", **{"exchange__method": method} | gains | driver)
        super().__init__(controller_config.settings_from(body, driver), (0.0,))

    def go(self, place, shift=0.0, **inputs):
        """The next deadline, with a stamp that is `shift` periods wrong; the motor's force."""
        return super().go(place, shift=shift, stamp_error=self.told * self.period * 1e9, **inputs)[0]

    def zigzag(self, shift, seconds=2.0):
        """At half of the servo's rate, with the stamps alternately early and late."""
        for _ in range(round(seconds / self.period) // 2):
            self.go((SPEED * self.period,), shift)
            self.go((0.0,), -shift)
        return self


@pytest.mark.parametrize("error", [0.0, 0.25, 0.4])
@pytest.mark.parametrize("gains", GAINS)
def test_a_zigzag_with_stamps_alternately_wrong_draws_nothing_from_a_display_that_knows_their_error(gains, error):
    for shift in (error, -error):
        led = Stamped(*gains, told=error).zigzag(shift)
        assert led.most <= BUDGET and led.given < 0.0
        assert led.row["energy_given"][0, 0] >= led.given - 1e-9  # as the servo counts it, never less than the truth


@pytest.mark.parametrize("share, draws", [(0.97, False), (1.03, True)])
def test_a_damper_of_believed_times_acts_as_one_of_b_over_1_less_four_times_the_squared_error(share, draws):
    """Half of the velocities are over T − 2u and half over T + 2u: B/2 (T/(T − 2u) + T/(T + 2u))."""
    error, physical = 0.25, 3.0
    damping = share * physical * (1.0 - 4.0 * error**2)
    apart = {"method": "direct", "passivity__control": False, "passivity__policy": "off", "cancellation__ratio": 0.0}
    hidden, told = (Stamped(1000.0, 0.01, damping, physical, told, **apart) for told in (0.0, error))
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
        led = Stamped(rate, 1.5 * stiffness, damping, physical, error, **driver)
        if gain_check.margins(led.settings[0], gain_check.delays(led.settings[0]))[1] <= 0.0:
            break
        stiffness *= 1.5
    led, way, force = Stamped(rate, stiffness, damping, physical, error, **driver), 0.0, 0.0
    wide, follows = int(2.0 ** random.uniform(0.0, 5.0)), random.random()
    shifts = random.uniform(-error, error, 2000) if random.random() < 0.5 else random.choice([-error, error], 2000)
    for k, shift in enumerate(shifts):
        way = way if k % wide else random.normal() * SPEED / rate
        step = abs(way) * np.sign(force) if random.random() < follows else way
        place = led.place[0]
        force = led.go((place + step if abs(place + step) < 0.05 else 0.5 * place,), shift)
    assert led.most <= BUDGET


@pytest.mark.parametrize("error, fits", [(0.0, True), (1e-4, False)])
def test_gains_are_judged_with_the_error_that_a_description_tells_as_with_a_delay(error, fits):
    settings = Stamped(1000.0, 1000.0, 0.25, 1.05 * 0.75, error * 1000.0).settings
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
def test_an_account_in_debt_lets_coupling_and_walls_go_until_it_is_paid(axes, offset):
    wall = {"wall__offsets": (offset,), "wall__stiffness": (100.0,), "wall__damping": (0.5,)}
    led = Stamped(1000.0, 100.0, 1.0, 3.0, 0.0, axes=axes, wall__normals=(1.0, 0.0), **wall)
    weights = led.memory["rows"]["weight"][0]
    led.go((-1e-3,))
    assert (weights[0], weights[6]) == (1.0, 1.0)
    led.memory["account"]["free"] = -1e-3
    led.go((-1e-3,))
    assert (weights[0], weights[6]) == (0.0, 0.0 if offset == 0.0 else 1.0)  # a slack spring has nothing to let go of
    for k in range(3000):  # the hand fills the account
        led.go((3e-4 * (k // 8 % 2),))
    assert led.free >= 0.0 and (weights[0], weights[6]) == (1.0, 1.0)
