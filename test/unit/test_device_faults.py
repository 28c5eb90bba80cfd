# SPDX-License-Identifier: Apache-2.0
"""Faults that a device finds itself, words of status that are none, and devices whose counts jump or begin anew."""

import uuid

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_servo import FREE, PERIOD, WALL, Servo

from haptic_device.control import enable_state, faults
from haptic_device.realtime import hardware_interface, shared_memory

BITS = {
    "device_estop": faults.BUTTON,
    "device_encoder": faults.BROKEN_ENCODER,
    "device_hot": faults.HOT,
    "device_limit": faults.END_SWITCH,
    "device_watchdog": faults.WATCHDOG,
}
"""Name of the fault → bit of the status word, in the order in which they latch where several are set."""
ALWAYS = ("device_estop", "device_hot", "device_encoder")  # enabled or not
ENABLE, RESET, CLUTCH = enable_state.ENABLE, enable_state.RESET, enable_state.CLUTCH
SILENCE = 0.02  # [s], fault.silence
WAY = 10.0 * PERIOD * 1e7  # counts that the device's velocity limit allows in a tick


def pressing():
    """A servo that presses a wall with 2 N."""
    runner = Servo(**WALL, **FREE, engage__time=0.1)
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=1e-3)
    return runner


def fault_of(row):
    return faults.name_of(row.fault)


def test_bits_of_the_status_word_are_those_of_the_link_protocol_and_one_each():
    assert [faults.FRESH, *BITS.values(), faults.CLAMPED] == [1, 4, 32, 8, 16, 2, 128]
    assert shared_memory.WATCHDOG == faults.WATCHDOG and sum(BITS.values()) + faults.CLAMPED == faults.DEVICE_BITS


@pytest.mark.parametrize("name", ALWAYS)
def test_what_the_device_finds_latches_though_the_display_is_not_enabled(name):
    runner = Servo(**FREE)
    runner.command = 0
    runner.tick()
    assert fault_of(runner.tick()) == "" and fault_of(runner.tick(device_status=BITS[name])) == name
    assert fault_of(runner.run(0.01)) == name and runner.rows[-1]["state"][0] == enable_state.FAULT


@pytest.mark.parametrize("command", [0, CLUTCH, ENABLE | CLUTCH])
def test_an_end_switch_is_no_fault_while_nothing_can_push_the_handle(command):
    runner = Servo(**FREE)
    runner.command = command
    runner.tick()
    row = runner.run(0.05, device_status=faults.FRESH | faults.END_SWITCH)
    assert fault_of(row) == "" and not row.motor.any() and row.state == enable_state.IDLE


def test_an_end_switch_latches_in_the_tick_that_enables_before_any_force_and_not_beside_it():
    runner = pressing()
    runner.command, runner.inputs["device_status"] = 0, faults.FRESH | faults.END_SWITCH
    assert fault_of(runner.run(0.01)) == ""
    runner.command, before = ENABLE, len(runner.rows)
    assert fault_of(runner.run(0.01)) == "device_limit"
    assert all(row["fault"][0] and not row["motor"].any() for row in runner.rows[before:])
    runner.inputs["device_status"], runner.command = faults.FRESH, RESET
    runner.tick()
    runner.move((0.0, 0.0, 0.0))
    runner.command |= ENABLE
    assert runner.run(0.2).state == enable_state.ENGAGED


def test_an_end_switch_that_is_reached_while_enabling_waits_for_a_small_force_latches():
    runner = pressing()
    runner.command = 0
    runner.tick()
    runner.command = ENABLE
    assert runner.run(0.01).state == enable_state.WAITING
    assert fault_of(runner.tick(device_status=faults.FRESH | faults.END_SWITCH)) == "device_limit"


@pytest.mark.parametrize("enabled", [0, ENABLE])
@pytest.mark.parametrize("name", [*ALWAYS, "device_limit"])
def test_while_the_bit_stays_a_reset_latches_it_again_in_its_tick_and_once_it_is_gone_it_does_not(name, enabled):
    runner = pressing()
    runner.inputs["device_status"] = faults.FRESH | BITS[name]
    assert fault_of(runner.tick()) == name
    for turn in range(1, 4):
        runner.command = turn * RESET | enabled
        row = runner.tick()
        again = name if enabled or name in ALWAYS else ""
        assert fault_of(row) == again and not row.motor.any()
    runner.inputs["device_status"] = faults.FRESH
    assert fault_of(runner.run(0.01)) == again  # gone by itself is not cleared
    runner.move((0.0, 0.0, 0.0))
    runner.command = 4 * RESET
    assert fault_of(runner.tick()) == ""
    runner.command |= ENABLE
    assert runner.run(0.2).state == enable_state.ENGAGED
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("first", range(len(BITS)))
def test_of_bits_that_come_together_the_first_of_the_order_latches_and_stays(first):
    names, runner = list(BITS), pressing()
    row = runner.tick(device_status=sum(list(BITS.values())[first:]))
    assert fault_of(row) == names[first] and not row.motor.any()
    assert fault_of(runner.tick(device_status=sum(BITS.values()))) == names[first]


def test_the_call_of_estop_comes_before_the_button_and_the_button_before_silence():
    runner = pressing()
    assert fault_of(runner.tick(device_status=faults.DEVICE_BITS, command=ENABLE | enable_state.ESTOP)) == "estop"
    runner, late = pressing(), 2 * SILENCE * 1e9
    assert fault_of(runner.tick(device_status=faults.DEVICE_BITS, latched=runner.now - late)) == "device_estop"
    runner = pressing()
    assert fault_of(runner.tick(device_status=faults.HOT, latched=runner.now - late)) == "device_silent"


@pytest.mark.parametrize("word", [0, faults.FRESH, faults.CLAMPED, 64, 256, 2.0**60, faults.FRESH | faults.CLAMPED])
def test_a_clamped_value_and_unknown_bits_are_no_faults(word):
    row = pressing().tick(device_status=word)
    assert fault_of(row) == "" and row.motor[0] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("name", BITS)
def test_a_device_that_cut_its_motor_leaves_the_tank_nothing_that_the_hand_earned_meanwhile(name):
    runner = Servo(exchange__method="pspm", coupling__stiffness=200.0, coupling__damping=1.0, engage__time=0.1)
    runner.tool((0.002, 0.0, 0.0))
    runner.inputs |= {"tool_session": 1.0, "tool_contact": 1.0}
    for number in range(1, 1200):
        runner.inputs |= {"tool_answered": float(number), "tool_sequence": float(number)}
        row = runner.tick()
    assert runner.memory["spring"]["factor_held"][0] > 0.0 and runner.memory["tank"]["level"][0] > 0.0
    assert row.motor[0] > 0.0
    runner.tick(device_status=faults.FRESH | BITS[name])
    emptied = runner.memory["tank"]["level"][0] <= 0.0
    assert emptied == (name != "device_limit")


@pytest.fixture
def page():
    """The device's side of a page, and the servo's hardware interface on it."""
    name = f"haptic_display.test.{uuid.uuid4().hex}"
    device = shared_memory.SharedMemory(name, shared_memory.DEVICE)
    link = hardware_interface.SharedMemoryInterface(name, 7)
    yield device, link
    link.close()
    device.close()
    assert not (shared_memory.FOLDER / name).exists()


def status_read(page, word):
    """What the servo reads of this status word on the page."""
    device, link = page
    sample = np.zeros(hardware_interface.SAMPLE)
    block = np.zeros(shared_memory.DEVICE_WORDS, np.int64)
    shared_memory.write_device(device.words, block, 1, 1000, word, 1000, np.array([5.0, 6.0, 7.0]), np.zeros(3), 0)
    assert link.read(link.memory, 1000, 0, sample) == 1
    assert sample[hardware_interface.COUNTS :].tolist() == [5.0, 6.0, 7.0, 0.0, 0.0, 0.0]
    return sample[hardware_interface.STATUS]


def test_of_any_word_on_the_page_the_known_bits_are_read_and_no_others(page):
    known = faults.DEVICE_BITS

    @given(st.integers(-(2**63), 2**63 - 1) | st.integers(0, 255) | st.integers(0, 62).map(lambda bit: 1 << bit))
    def reads(word):
        assert status_read(page, word) == word & known

    reads()


@pytest.mark.parametrize("far", [0, 2**53, 2**60, -(2**63), 2**62 + 64 + 1])
def test_whatever_else_a_word_says_a_watchdog_that_cut_is_not_missed(page, far):
    status = status_read(page, far | faults.WATCHDOG)
    row = pressing().tick(device_status=status)
    assert fault_of(row) == "device_watchdog" and not row.motor.any()
    assert fault_of(pressing().tick(device_status=status_read(page, far))) == ""


@pytest.mark.parametrize("word", [-1.0, -2.0])
def test_a_word_that_is_negative_sets_all_its_bits(word):
    assert fault_of(pressing().tick(device_status=word)) == "device_estop"


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(
    ("counts", "name"),
    [
        *((65536, "encoder_jump"), (-65536, "encoder_jump")),  # a counter of 16 bits that was not unwrapped
        *((2.001 * WAY, "encoder_jump"), (1.999 * WAY, "velocity"), (1.001 * WAY, "velocity"), (0.999 * WAY, "")),
    ],
)
def test_counts_that_jump_by_more_than_twice_the_velocity_limit_are_a_fault_in_their_tick(counts, name, axis):
    runner = pressing()
    runner.position = runner.position + 1e-7 * round(counts) * (np.arange(3) == axis)
    row = runner.tick()
    assert fault_of(row) == name
    assert name == "" or not row.motor.any()


@pytest.mark.parametrize(("share", "name"), [(2.001, "encoder_jump"), (1.999, "velocity")])
def test_a_jump_after_ticks_without_a_sample_is_one_by_the_time_between_samples(share, name):
    runner, held = pressing(), 20
    runner.settings["hardware"]["velocity_limit"] = limit = 1.0
    for _ in range(held - 1):
        assert fault_of(runner.tick(stale=True)) == ""
    runner.position = runner.position + [share * limit * held * PERIOD, 0.0, 0.0]
    assert fault_of(runner.tick()) == name


def silent(runner, seconds):
    """The device leaves no sample for this time; how many ticks it took to latch."""
    rows = [runner.tick(stale=True).copy() for _ in range(round(seconds / PERIOD))]
    latched = [fault_of(row) for row in rows]
    assert all(not row.motor.any() for row in rows if row.fault)
    assert set(latched) == {"", "device_silent"} and latched == sorted(latched)
    return latched.count("")


@pytest.mark.parametrize("at_once", [False, True])
@pytest.mark.parametrize("place", [0.0, -0.02, 0.05])
@pytest.mark.parametrize("coupled", [False, True])
def test_a_device_that_returns_with_other_counts_is_silent_first_and_pushes_nobody_after_the_reset(
    coupled, place, at_once
):
    """A replug: counts begin anew after 1 s, which is time enough for such a way at a moderate speed."""
    runner = Servo(coupling__stiffness=1000.0, engage__time=0.1) if coupled else pressing()
    if coupled:
        runner.tool((0.0, 0.0, 0.0))
        runner.move((-0.002, 0.0, 0.0))
    assert runner.run(0.3).motor[0] == pytest.approx(2.0, rel=1e-3)
    assert silent(runner, 1.0) == pytest.approx(SILENCE / PERIOD, abs=1)
    runner.position = np.array([place, 0.0, 0.0])
    began = len(runner.rows)
    if not at_once:  # else the reset comes in the very tick of the new counts, and forces are wished for all the time
        row = runner.run(0.01)
        assert fault_of(row) == "device_silent" and row.position[0] == pytest.approx(place, abs=1e-6)
    runner.command = RESET | ENABLE
    row = runner.tick()
    assert row.position[0] == pytest.approx(place, abs=1e-6)
    row = runner.run(0.5)
    far = abs(place if coupled else min(0.0, place)) > 0.001  # 1 N at 1000 N/m, engage.force
    assert fault_of(row) == "" and row.state == (enable_state.WAITING if far else enable_state.ENGAGED)
    assert all(np.abs(row["motor"]).max() < 1e-3 for row in runner.rows[began:])
    row = runner.move((0.0, 0.0, 0.0))
    assert runner.run(0.3).state == enable_state.ENGAGED
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=0.01)
