# SPDX-License-Identifier: Apache-2.0
"""What the account charges in advance has a physical limit, and what it charged beyond the truth is forgotten."""

import numpy as np
import pytest
from exchange_systems import demo_system, one_axis
from ticks import tick

from adversary import exchange_search as adversary
from haptic_device.control import enable_state, faults, gain_check, records

STIFFNESS, DAMPING, PERIOD, FASTEST = 2000.0, 2.0, 0.5e-3, 1.0  # [N/m], [N s/m], [s], [m/s] of the device
BUDGET, STRETCH = 0.005, 0.004  # [J], [m]
OPEN = enable_state.ENABLE | enable_state.CLUTCH


class Led:
    """A handle led by hand, whose display counts with this lateness [s] and whose tool stands 4 mm from its start.

    step: of the encoder [m]; force: of the spring [N] when the handle is let stand.
    """

    contact = 1.0

    def __init__(self, late, over=1.05, step=1e-9, stiffness=STIFFNESS, method="pspm", **driver):
        self.settings = one_axis(method, stiffness, DAMPING, PERIOD, over, 1.0 / step, FASTEST, **driver)
        gain_check.counted(self.settings, late)
        (self.memory, self.row), self.place, self.now, self.number = adversary.engaged(), 0.0, 0.0, 0
        self.step, self.tool, self.age, self.speed = step, 0.0, 0.0, 0.0
        self.lead(0.0)

    def lead(self, way, time=PERIOD, command=enable_state.ENABLE):
        """The next tick, this long after the last one, in which time the handle has gone this way [m]."""
        row = self.row[0]
        self.place, self.now, self.number = self.place + way, self.now + time, self.number + 1
        row["latched"] = row["deadline"] = self.now * 1e9
        row["command"], row["device_status"], row["counts"][0] = command, faults.FRESH, round(self.place / self.step)
        row["tool_session"], row["tool_contact"] = 1.0, self.contact
        row["tool_age"], row["tool_position"][0], row["tool_velocity"][0] = self.age, self.tool, self.speed
        row["tool_sequence"] = row["tool_answered"] = self.number
        tick(self.settings, self.memory, self.row)
        return self

    def stretched(self):
        """Led 4 mm away from the tool, as slowly as the damping takes it, and let stand."""
        for _ in range(800):
            self.lead(-STRETCH / 800.0)
        return self.lead(0.0).lead(0.0)

    account = property(lambda self: self.memory["account"][0])

    free = property(lambda self: float(self.account["free"]))  # what the account may still give [J]

    force = property(lambda self: float(self.account["spring"][0]))  # of the coupling's spring [N]

    # physical damping of the device [N s/m]
    damping = property(lambda self: float(self.settings["hardware"]["damping"][0, 0]))

    # what the motor has given at most [J], as the account counts it
    given = property(lambda self: float(self.account["given"]))

    # what account and springs may still give, or was shipped, less the budget [J]
    books = property(lambda self: adversary.booked(self.settings[0], self.memory[0], self.row.view(records.TICK)[0]))


def test_a_stall_costs_no_more_than_the_force_limit_over_the_way_either_side_of_it():
    """50 ms at 0.9 m/s: the spring alone would hold 2 J, its limit of 5 N lets it give and keep .225 J each."""
    limit, way = 5.0, 0.045
    led = Led(0.0, force__limit=limit)
    led.lead(0.0, 0.05).lead(0.0)
    before = led.free
    led.lead(-way, 0.05)
    assert 0.5 * STIFFNESS * way**2 > 2.0
    assert before - led.free <= 2.0 * limit * way


def test_a_stall_of_a_motor_that_is_off_costs_nothing_whatever_would_be_cancelled():
    led = Led(0.0, over=20.0, cancellation__ratio=0.9)
    led.lead(0.0, command=0)
    before = led.free
    for way in (0.045, -0.045, 0.045):
        led.lead(way, 0.05, command=0).lead(0.0, command=0)
    assert led.free >= before


def test_a_stall_while_damping_is_cancelled_costs_no_more_than_a_tick_of_it_at_steady_speed():
    """What it cancels it takes from the damper that took as much."""
    led, speed = Led(0.0, over=4.0, cancellation__ratio=0.9), 0.5
    led.age = -1.0  # no tool
    for _ in range(2000):
        led.lead(speed * PERIOD)
    assert led.row["force_cancellation"][0, 0] > 1.0
    before, cancelled = led.free, 0.9 * led.damping
    led.lead(speed * 0.05, 0.05)
    assert before - led.free <= 0.5 * cancelled * PERIOD * speed**2 * (1.0 + 1e-6)


@pytest.mark.parametrize("word", [OPEN, 0])
def test_a_debt_that_is_not_true_is_forgotten_where_the_spring_is_let_go_and_what_was_given_is_not(word):
    for given in (0.0, 0.003, 0.02):
        led = Led(0.0)
        led.account["free"], led.account["given"] = -3e7, given
        for _ in range(4):
            led.lead(0.0, command=word)
        assert led.free == pytest.approx(BUDGET - given)


def test_a_resting_hand_gets_its_coupling_back_without_letting_go():
    """A spring in debt lets go: that forgets the debt. With 4 mm the budget pays for a share w of it, w K x²/2."""
    led = Led(0.0, passivity__control=True).stretched()
    led.account["free"], led.account["given"] = -3e7, 0.0
    for _ in range(100):
        led.lead(0.0)
    assert led.force == pytest.approx(2.0 * BUDGET / STRETCH, rel=1e-3) and led.free >= 0.0


def test_enabling_again_and_again_gives_one_budget_in_all():
    """A tool that pulls the handle: all that the tank gives is given, and the handle is let go."""
    led, work = Led(0.0), 0.0
    for _ in range(8):
        for k in range(60):
            led.tool = led.place + 0.01
            force = float(led.row["force_on_handle"][0, 0])
            way = force * PERIOD / (4.0 * led.damping)
            led.lead(way, command=enable_state.ENABLE if k < 50 else 0)
            work += force * way - led.damping * way * way / PERIOD
    assert BUDGET / 10.0 < work <= BUDGET


@pytest.mark.parametrize("speed", [0.0, 0.001, 0.1])
def test_a_handle_that_is_let_go_gets_back_no_more_than_its_damper_takes_however_coarse_the_encoder(speed):
    """At rest the encoder flickers by a step: 20 µm to and fro in every tick would be 5 mW, were it a way."""
    led = Led(0.0, step=2e-5)
    led.lead(0.0, command=0).lead(0.0, command=0)
    led.account["free"], led.account["given"] = 0.0, BUDGET
    time = 0.01 / speed if speed else 2.0
    for k in range(round(time / PERIOD)):
        led.lead(speed * PERIOD if speed else led.step * (-1.0) ** k, command=0)
    taken = led.damping * speed**2 * time
    assert led.free <= taken < BUDGET
    assert speed < 0.1 or led.free > 0.3 * taken


def test_a_stretched_coupling_gives_nothing_to_a_resting_handle_whose_encoder_flickers():
    led = Led(0.0, step=2e-5).stretched()
    before = led.given
    for k in range(1000):
        led.lead(led.step * (-1.0) ** k)
    assert led.force > 1.0 and led.given <= before + 1e-9


def test_a_handle_whose_damping_is_cancelled_gets_one_budget_in_all():
    """A tool pulls it until nothing is left; then it goes on alone, where of its damping but two fifths are there."""
    led, work, most = Led(0.0, over=1.5, cancellation__ratio=0.6, exchange__fade=0.001), 0.0, 0.0
    for _ in range(4):
        for k in range(180):
            led.tool, led.age = led.place + 0.01, 0.0 if k < 60 else -1.0
            force = float(led.row["force_on_handle"][0, 0])
            way = force * PERIOD / (4.0 * led.damping) if k < 61 else 0.25 * PERIOD
            led.lead(way)
            work += force * way - led.damping * way * way / PERIOD
            most = max(most, work)
    assert BUDGET / 10.0 < most <= BUDGET


def test_what_the_coupling_gave_until_a_tool_sample_that_is_no_number_is_counted():
    led = Led(0.0).stretched()
    led.account["given"], force, way = 0.02, led.force, 1e-5
    led.tool = np.nan
    led.lead(way)
    assert led.row["fault"][0] == faults.NOT_A_NUMBER
    assert led.given == pytest.approx(0.02 + force * way, abs=1.1 * led.damping * way**2 / PERIOD)


@pytest.mark.parametrize("hold, speed", [(0.001, FASTEST), (0.05, 0.2), (0.05, FASTEST)])
def test_missed_ticks_give_no_more_beyond_the_budget_than_one_of_their_holds_can(hold, speed):
    """A hand goes with the force for all of each hold: that gives min(F v, F²/4b) times its length, and once only."""
    led, given, most = Led(0.0, passivity__control=True).stretched(), 0.0, 0.0
    damping, limit = led.damping, led.settings["force"]["limit"][0, 0]
    paid = led.books  # what the hand had put in
    for _ in range(20):
        for time in (hold, PERIOD, PERIOD):
            force = float(led.row["force_on_handle"][0, 0])
            way = np.sign(force) * min(speed, abs(force) / (2.0 * damping)) * time
            led.lead(way, time)
            given += force * way - damping * way * way / time
            most = max(most, given)
    assert most <= max(0.0, paid) + BUDGET + min(limit * speed, limit**2 / (4.0 * damping)) * hold
    assert most > 0.0


@pytest.mark.parametrize("moving", [True, False])
def test_where_writes_are_late_beyond_the_margin_for_a_second_the_force_is_back_half_a_second_after(moving):
    """At 2 kHz with K 2000, B 2 on a wall. moving: the hand goes on in and out; else it rests and enables anew."""
    hand = {"name": "tap", "taps": 12, "duration": 6.0} if moving else {"name": "press_wall", "duration": 5.0}
    system = demo_system("pspm", "wall", motion=hand, servo__rate=2000.0)

    def go(seconds, late=0.0):
        system.write_delay = round(late * 1e9)
        gain_check.counted(system.settings, late + float(system.settings["hardware"]["delay"][0]))
        return system.run(seconds)

    well, late = go(1.5), go(1.0, 400e-6)
    go(0.02)
    if not moving:
        system.command = 0
        system.run(0.05)
        system.command = enable_state.ENABLE
    go(0.5)
    after = go(1.0)
    assert late["margin"][-1].min() < 0.0 < min(well["margin"][-1].min(), after["margin"][-1].min())
    # who moves stretches the coupling, who rests has what the budget pays for
    wanted = np.abs(well["force_coupling"][:, :2]).max() if moving else np.sqrt(2.0 * STIFFNESS * BUDGET)
    assert np.abs(after["force_coupling"][:, :2]).max() > 0.8 * wanted > 2.0
    assert float(np.max(system.plant_memory["energy_given"][0])) <= BUDGET


class Clutched(Led):
    """With a free tool; forged: the most [J] that account, spring and what was shipped ever were above the truth."""

    contact, work, forged = 0.0, 0.0, -np.inf

    def lead(self, way, time=PERIOD, command=enable_state.ENABLE):
        # the work of the motor, less the least that the damper takes
        self.work += float(self.row["force_on_handle"][0, 0]) * way - self.damping * way * way / time
        super().lead(way, time, command)
        self.forged = max(self.forged, self.work + self.books)
        return self


@pytest.mark.parametrize("method, toward", [("pspm", -1.0), ("pspm", 1.0), ("local", -1.0)])
def test_eight_clutchings_at_8_newtons_and_300_mm_s_put_no_more_into_the_books_than_the_hand_did(method, toward):
    led = Clutched(0.0, 1.5, method=method, engage__time=0.01, engage__force=100.0)
    way = 0.3 * PERIOD
    for _ in range(8):
        pulled = 0
        while abs(led.row["force_on_handle"][0, 0]) < 8.0 and pulled < 400:
            led.lead(way)
            pulled += 1
        assert abs(led.row["force_on_handle"][0, 0]) >= 8.0
        # along the force or against it, in the tick that opens the clutch too
        led.lead(toward * way).lead(toward * way, command=OPEN)
        assert led.row["force_on_handle"][0, 0] == 0.0
        for _ in range(20):
            led.lead(-way, command=OPEN)
        for _ in range(30):
            led.lead(0.0)
    assert led.row["engage"][0] == 1.0
    assert led.forged <= 1e-9
