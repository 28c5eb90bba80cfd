# SPDX-License-Identifier: Apache-2.0
"""The table of faults at the servo: each from both sides of its bound, its number, and devices that misbehave."""

import math
import re
import uuid

import numpy as np
import pytest
from fault_table import FREE, PERIOD, PROVOKED, Servo, fault_of, pressing
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.control import enable_state, faults
from haptic_device.nodes import fault_detail
from haptic_device.nodes.fault_detail import KEPT, LatchedFault
from haptic_device.realtime import hardware_interface, shared_memory

BITS = {
    "device_estop": faults.BUTTON,
    "device_clock": faults.CLOCK,
    "device_encoder": faults.BROKEN_ENCODER,
    "device_hot": faults.HOT,
    "device_limit": faults.END_SWITCH,
    "device_watchdog": faults.WATCHDOG,
}
"""Name of the fault → bit of the status word, in the order in which they latch where several are set."""
ALWAYS = ("device_estop", "device_clock", "device_hot", "device_encoder")  # enabled or not
ENABLE, RESET, CLUTCH = enable_state.ENABLE, enable_state.RESET, enable_state.CLUTCH
SILENCE = 0.02  # [s], fault.silence
UNHEARD, LATE = "no command came over the line", "0.0202 s; the limit is 0.02 s"


def told(runner, block=3 * KEPT):
    """What is told of the fault that the runner is in, its rows taken in blocks."""
    rows, latched = np.concatenate(runner.rows[-5000:]).ravel(), LatchedFault()
    for at in range(0, len(rows), block):
        latched.add(rows[at : at + block], runner.settings[0])
    return latched.sentence(int(rows["fault"][-1]))


@pytest.mark.parametrize("name", PROVOKED)
def test_a_fault_latches_just_beyond_its_bound_with_the_motor_at_zero_until_a_reset_once_its_cause_is_over(name):
    assert PROVOKED.keys() == faults.FAULTS.keys()
    fault, runner = PROVOKED[name], pressing()
    row = fault.go(runner, 0.99)
    assert fault_of(row) == ("velocity" if name == "encoder_jump" else "")
    assert row.motor.any() == (name != "encoder_jump")
    runner = pressing()
    before, inputs = runner.settings.copy(), dict(runner.inputs)
    assert fault_of(fault.go(runner, 1.01)) == name
    sentence = told(runner)
    assert re.fullmatch(fault.told, sentence)
    assert fault_of(runner.tick(command=ENABLE | enable_state.ESTOP, device_status=faults.DEVICE_BITS)) == name
    row = runner.run(0.02)
    assert fault_of(row) == name and row.state == enable_state.FAULT and told(runner) == sentence
    runner.command = RESET
    if fault.lasts is not None:
        command = RESET | fault.lasts.get("command", 0)
        assert fault_of(runner.run(1.1 * SILENCE, **fault.lasts | {"command": command})) == name
    runner.settings, runner.inputs, runner.command = before, inputs, RESET | ENABLE
    row = runner.run(0.1)  # past a jump's own velocity
    if fault.lasts is not None:  # gone by itself is not cleared
        assert fault_of(row) == name and told(runner) == told(runner, 1) == told(runner, 7)
    assert not any(row["motor"].any() or row["force_on_handle"].any() for row in runner.rows if row["fault"][0])
    runner.position[:] = 0.0
    runner.memory["motion"]["device_position"] = 0.0  # the handle was carried back
    runner.command = 2 * RESET
    runner.run(0.1)
    runner.command |= ENABLE
    assert runner.run(0.2).state == enable_state.ENGAGED
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=1e-3)


def test_a_motor_that_holds_a_little_more_than_its_duty_is_warm_after_the_time_of_its_thermal_model():
    runner, share = pressing(), 1.01
    began = len(runner.rows)
    PROVOKED["duty"].go(runner, share)
    held = next(k for k, row in enumerate(runner.rows[began:]) if row["fault"][0]) * PERIOD
    assert held == pytest.approx(-0.05 * math.log(1.0 - 1.0 / share**2), rel=0.01)


def test_a_number_is_told_only_beyond_its_limit_with_as_many_digits_as_tell_them_apart():
    runner = pressing()
    row, device = runner.rows[-1].ravel()[-1:].copy(), runner.settings[0]["hardware"]
    device["position_low"], device["position_high"], device["velocity_limit"] = -0.12, 0.12, 0.6
    place = "the handle was at y = {} m; the workspace ends at {} m".format
    speed = "{} m/s along y; the limit is 0.6 m/s".format
    for code, value, said in (
        (faults.POSITION, -0.1201, place("−0.1201", "−0.12")),
        (faults.POSITION, 0.120005, place("0.120005", "0.12")),
        (faults.POSITION, 0.12, ""),
        (faults.VELOCITY, -0.60004, speed("0.60004")),
        (faults.VELOCITY, 0.6000000000004, speed("just beyond 0.6")),
        (faults.VELOCITY, 0.599, ""),
    ):
        row["fault"], row["velocity"] = code, (0.0, value, 0.0)
        row["counts"] = (0.0, round(value / device["position_per_count"][1]), 0.0)
        assert fault_detail.told(row, runner.settings[0])[0] == said


@pytest.mark.parametrize(
    ("link", "fault", "missed", "number", "first"),
    [
        ("loopback", "device_watchdog", 0.1, "the servo gave no command for 0.1 s", faults.BUSY),
        ("udp", "device_watchdog", 0.012, "the servo gave no command for 0.0123 s", faults.BUSY),
        ("udp", "device_watchdog", 0.0025, f"{UNHEARD} to the device for 0.015 s; the servo gave it", faults.WAY_THERE),
        ("loopback", "device_silent", 0.0, f"no sample of haptic_loopback for {LATE}", faults.BUSY),
        ("serial", "device_silent", 0.0, f"no sample came over the line from the device for {LATE}", faults.DEVICE),
        ("udp", "device_hot", 0.0, "", "let the device cool"),
    ],
)
def test_a_fault_of_the_line_names_the_end_that_it_came_about_at(link, fault, missed, number, first):
    runner, latched = pressing(), LatchedFault(link, lambda: 0.015)
    runner.now += round(missed * 1e9)
    PROVOKED[fault].go(runner, 1.01)
    latched.add(np.concatenate(runner.rows).ravel(), runner.settings[0])
    code = faults.FAULTS[fault].code
    assert (latched.sentence(code), latched.first(code)) == (number, first)
    assert latched.first(faults.ESTOP) == ""


def test_a_fault_has_no_number_of_the_fault_before_it():
    runner, latched = pressing(), LatchedFault()
    PROVOKED["position"].go(runner, 1.01)
    latched.add(np.concatenate(runner.rows).ravel(), runner.settings[0])
    assert latched.sentence(faults.POSITION) and latched.sentence(faults.ESTOP) == ""
    runner.settings["hardware"]["position_low"] = -1.0
    runner.run(0.01, command=RESET)
    PROVOKED["estop"].go(runner, 1.01)
    latched.add(np.concatenate(runner.rows[-20:]).ravel(), runner.settings[0])
    assert latched.sentence(faults.ESTOP) == latched.sentence(faults.POSITION) == ""


def test_bits_of_the_status_word_are_those_of_the_link_protocol_and_one_each():
    assert [faults.FRESH, *BITS.values(), faults.CLAMPED] == [1, 4, 64, 32, 8, 16, 2, 128]
    assert shared_memory.WATCHDOG == faults.WATCHDOG and sum(BITS.values()) + faults.CLAMPED == faults.DEVICE_BITS


def test_only_what_the_device_finds_itself_latches_though_the_display_is_not_enabled():
    for command in (0, CLUTCH, ENABLE | CLUTCH):
        for name, bit in BITS.items():
            runner = Servo(**FREE)
            runner.command = command
            runner.tick()
            row = runner.run(0.01, device_status=faults.FRESH | bit)
            if name != "device_watchdog" or not command & ENABLE:
                assert fault_of(row) == (name if name in ALWAYS else "") and not row.motor.any()
    assert fault_of(Servo(settled=False, **FREE).tick(device_status=faults.WATCHDOG)) == "", "it has not engaged"


def test_a_display_enabled_on_its_end_switch_latches_before_any_force_and_not_beside_it():
    for reached in ("before", "while it waits for a small force"):
        runner, switch = pressing(), faults.FRESH | faults.END_SWITCH
        runner.command, runner.inputs["device_status"] = 0, switch if reached == "before" else faults.FRESH
        assert fault_of(runner.run(0.01)) == ""
        runner.command, before = ENABLE, len(runner.rows)
        if reached != "before":
            assert runner.run(0.01).state == enable_state.WAITING
        assert fault_of(runner.tick(device_status=switch)) == "device_limit"
        assert not any(row["motor"].any() for row in runner.rows[before:])


def test_of_causes_that_come_together_the_first_of_the_order_latches():
    names = list(BITS)
    for first in range(len(names)):
        assert fault_of(pressing().tick(device_status=sum(list(BITS.values())[first:]))) == names[first]
    row = pressing().tick(device_status=faults.DEVICE_BITS, command=ENABLE | enable_state.ESTOP)
    assert fault_of(row) == "estop"


def test_a_hand_that_moves_against_a_motor_which_the_device_has_cut_earns_nothing():
    runner = Servo(exchange__method="pspm", coupling__stiffness=200.0, coupling__damping=1.0, engage__time=0.1)
    runner.tool((0.002, 0.0, 0.0))
    runner.inputs |= {"tool_session": 1.0, "tool_contact": 1.0}
    for count in range(1, 1200):
        runner.inputs |= {"tool_answered": float(count), "tool_sequence": float(count)}
        row = runner.tick()
    pull, way = row.force_on_handle[0], 1e-5
    assert pull == pytest.approx(0.4) and 3.0 * way**2 / PERIOD < 0.5 * pull * way

    def account():
        parts = [runner.memory["account"][name][0] for name in ("free", "stored", "late")]
        return sum(parts) + runner.memory["exchange"]["shipped"][0]

    filled, now, before = runner.memory.copy(), runner.now, account()
    runner.position = np.array([-way, 0.0, 0.0])
    for name, bit in BITS.items():
        runner.memory[:], runner.now = filled, now
        runner.tick(device_status=faults.FRESH | bit)
        earned = account() - before
        cut = name not in ("device_limit", "device_clock")
        assert earned <= 3.0 * way**2 / PERIOD if cut else earned > 0.9 * pull * way


def test_of_any_word_on_the_page_the_known_bits_are_read_and_no_others():
    name = f"haptic_display.test.{uuid.uuid4().hex}"
    device = shared_memory.SharedMemory(name, shared_memory.DEVICE)
    link = hardware_interface.SharedMemoryInterface(name, 7)

    def read(word):
        """What the servo reads of a device that leaves this status word on the shared page."""
        sample = np.zeros(hardware_interface.SAMPLE)
        block = np.zeros(shared_memory.DEVICE_WORDS, np.int64)
        shared_memory.write_device(
            device.words, block, 1, 1000, word, 1000, np.array([5.0, 6.0, 7.0]), np.zeros(3), 0, 0
        )
        assert link.read(link.memory, 1000, 0, sample) == 1
        assert sample[hardware_interface.COUNTS : hardware_interface.STAMP_ERROR].tolist() == [
            5.0,
            6.0,
            7.0,
            0.0,
            0.0,
            0.0,
        ]
        return sample[hardware_interface.STATUS]

    @given(st.integers(-(2**63), 2**63 - 1) | st.integers(0, 255) | st.integers(0, 62).map(lambda bit: 1 << bit))
    def reads(word):
        assert read(word) == word & faults.DEVICE_BITS

    reads()
    link.close()
    device.close()
    assert not (shared_memory.FOLDER / name).exists()
    for word in (0, 256, 2.0**60, faults.FRESH | faults.CLAMPED):
        row = pressing().tick(device_status=word)
        assert fault_of(row) == "" and row.motor[0] == pytest.approx(2.0, rel=1e-3)
    assert fault_of(pressing().tick(device_status=-1.0)) == "device_estop", "a negative word sets all its bits"


@pytest.mark.parametrize(("share", "name"), [(2.001, "encoder_jump"), (1.999, "velocity")])
def test_a_jump_after_ticks_without_a_sample_is_one_by_the_time_between_samples(share, name):
    runner, held = pressing(), 20
    runner.settings["hardware"]["velocity_limit"] = limit = 1.0
    for _ in range(held - 1):
        assert fault_of(runner.tick(stale=True)) == ""
    runner.position = runner.position + [share * limit * held * PERIOD, 0.0, 0.0]
    assert fault_of(runner.tick()) == name


def test_a_device_whose_time_was_far_ahead_once_is_silent_from_then_on():
    runner = pressing()
    runner.tick(latched=runner.now + 10**9)
    assert fault_of(runner.run(SILENCE - PERIOD)) == ""
    row = runner.run(2 * PERIOD)
    assert fault_of(row) == "device_silent" and not row.motor.any()


@pytest.mark.parametrize(
    ("coupled", "place", "at_once"),
    [(False, -0.02, False), (False, 0.05, True), (True, 0.05, False), (True, 0.0, True)],
)
def test_a_device_that_returns_with_other_counts_is_silent_first_and_pushes_nobody_after_the_reset(
    coupled, place, at_once
):
    """A replug: counts begin anew after a time that is enough for such a way at a moderate speed."""
    runner = Servo(coupling__stiffness=1000.0, engage__time=0.1) if coupled else pressing()
    if coupled:
        runner.tool((0.0, 0.0, 0.0))
        runner.move((-0.002, 0.0, 0.0))
    assert runner.run(0.3).motor[0] == pytest.approx(2.0, rel=1e-3)
    rows = [runner.tick(stale=True) for _ in range(round(0.3 / PERIOD))]
    assert not any(row.motor.any() for row in rows if row.fault)
    assert [fault_of(row) for row in rows].index("device_silent") == pytest.approx(SILENCE / PERIOD, abs=1)
    runner.position = np.array([place, 0.0, 0.0])
    began = len(runner.rows)
    if not at_once:  # else the reset comes in the very tick of the new counts, and forces are wished for all the time
        assert fault_of(runner.run(0.01)) == "device_silent"
    runner.command = RESET | ENABLE
    assert runner.tick().position[0] == pytest.approx(place, abs=1e-6)
    row = runner.run(0.5)
    far = abs(place if coupled else min(0.0, place)) > 0.001  # 1 N at 1000 N/m, engage.force
    assert fault_of(row) == "" and row.state == (enable_state.WAITING if far else enable_state.ENGAGED)
    assert all(np.abs(row["motor"]).max() < 1e-3 for row in runner.rows[began:])
    runner.move((0.0, 0.0, 0.0))
    assert runner.run(0.3).state == enable_state.ENGAGED
    assert runner.move((-0.002, 0.0, 0.0)).motor[0] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(("field", "value"), [("tool_velocity", math.inf), ("drag", -math.inf)])
def test_no_input_that_is_not_a_number_becomes_a_force(field, value):
    runner = Servo(cancellation__ratio=0.5, cancellation__source="measured", engage__time=0.1)
    runner.tool((0.0, 0.0, 0.0))
    runner.run(0.2)
    row = runner.tick(**{field: (0.0, value, 0.0)})
    assert fault_of(row) == "not_a_number" and not row.motor.any()
    assert row.state == enable_state.FAULT  # the device is told by it whether the display is engaged
    runner.command = RESET
    runner.run(0.01)
    runner.command |= ENABLE
    assert runner.run(0.2).state == enable_state.ENGAGED
    assert np.isfinite(runner.memory["compensation"]["drag"]).all()
