# SPDX-License-Identifier: Apache-2.0
"""The number of a latched fault, out of the rows of a servo, and the sentences that are made of it."""

import re
import time
from types import SimpleNamespace

import numpy as np
import pytest
from test_servo import PROVOKE, pressing

from haptic_device.control import enable_state, faults
from haptic_device.nodes.fault_detail import KEPT, LatchedFault, number
from haptic_device.status import Status
from haptic_sim.cli.status import newest
from haptic_sim.fault_sentence import FAULTS, PRESS, TYPE, cause, fell, steps, what_to_do

TOLD = {
    "estop": "",
    "device_silent": r"no answer for 0\.0[0-9]+ s; the limit is 0\.02 s",
    "not_a_number": r"the force of the coupling along x was not a number",
    "encoder_jump": r"x moved by 0\.005 m in 0\.25 ms; the limit is 0\.0045 m",
    "position": r"the handle was at x = −0\.002 m; the workspace ends at −0\.0019 m",
    "velocity": r"[0-9.]+ m/s along x; the limit is 2 m/s",
    "saturation": r"2(\.0[0-9])? N wanted along x for 1 s; the limit is 1\.9 N",
    "device_watchdog": "",
    "duty": r"a load of [0-9.]+ of the limit of x; fault\.duty is [0-9.]+",
    "unattended": r"the limit is 5 s",
    "device_estop": "",
    "device_hot": "",
    "device_limit": r"the handle was at x = −0\.002 m, y = 0 m, theta = 0 rad",
    "device_encoder": "",
}


def told(runner, block=7):
    """What is told of the fault that the runner is in, its rows taken in blocks."""
    rows, latched = np.concatenate(runner.rows).ravel(), LatchedFault()
    for at in range(0, len(rows), block):
        latched.add(rows[at : at + block], runner.settings[0])
    return latched.sentence(int(rows["fault"][-1]))


def test_each_fault_of_the_table_is_told():
    assert set(TOLD) == {entry.name for entry in faults.TABLE}


@pytest.mark.parametrize("block", [1, 7, 4 * KEPT])
@pytest.mark.parametrize("name", PROVOKE)
def test_a_latched_fault_is_told_with_the_numbers_of_its_tick_however_much_follows(name, block):
    runner = pressing()
    PROVOKE[name](runner)
    first = told(runner, block)
    assert re.fullmatch(TOLD[name], first)
    runner.run(0.1)
    assert told(runner, block) == first


def test_a_device_that_was_not_written_to_is_told_for_how_long():
    runner = pressing()
    rows = np.concatenate(runner.rows).ravel()[-10:].copy()
    rows["fault"][-1] = faults.DEVICE_WATCHDOG
    assert number(rows, runner.settings[0]) == ""
    rows["deadline"][-2:] += 0.1e9
    assert number(rows, runner.settings[0]) == "no command for 0.1 s"


@pytest.mark.parametrize(
    ("place", "said"), [(0.1201, True), (0.120005, True), (0.12, False), (-0.12, False), (-0.1201, True)]
)
def test_a_handle_within_the_workspace_is_not_said_to_be_outside(place, said):
    runner = pressing()
    row = np.concatenate(runner.rows).ravel()[-1:].copy()
    device = runner.settings[0]["hardware"]
    device["position_low"], device["position_high"] = -0.12, 0.12
    row["fault"], row["counts"][0, 1] = faults.POSITION, round(place / device["position_per_count"][1])
    end = "−0.12" if place < 0.0 else "0.12"
    at = f"{place:g}".replace("-", "−")
    sentence = f"the handle was at y = {at} m; the workspace ends at {end} m"
    assert number(row, runner.settings[0]) == (sentence if said else "")


@pytest.mark.parametrize(("speed", "said"), [(0.601, True), (0.60004, True), (0.599, False), (-0.601, True)])
def test_a_speed_is_told_with_its_limit_only_beyond_it(speed, said):
    runner = pressing()
    row = np.concatenate(runner.rows).ravel()[-1:].copy()
    runner.settings["hardware"]["velocity_limit"] = 0.6
    row["fault"], row["velocity"] = faults.VELOCITY, (0.0, 0.0, speed)
    sentence = f"{abs(speed):g} rad/s along theta; the limit is 0.6 rad/s"
    assert number(row, runner.settings[0]) == (sentence if said else "")


def test_a_fault_that_was_kept_over_a_pause_has_no_number_of_another_tick():
    runner = pressing()
    row = np.concatenate(runner.rows).ravel()[-1:].copy()
    for code in (faults.ENCODER_JUMP, faults.SATURATION, faults.VELOCITY, faults.POSITION, faults.DEVICE_WATCHDOG):
        row["fault"] = code
        latched = LatchedFault()
        latched.add(row, runner.settings[0])
        assert latched.sentence(code) == ""


def test_the_number_of_a_fault_is_not_that_of_the_fault_after_it():
    runner = pressing()
    PROVOKE["position"](runner)
    latched = LatchedFault()
    latched.add(np.concatenate(runner.rows).ravel(), runner.settings[0])
    assert latched.sentence(faults.POSITION) and latched.sentence(faults.ESTOP) == ""
    runner.command = enable_state.RESET
    runner.settings["hardware"]["position_low"] = -1.0
    runner.run(0.01)
    PROVOKE["estop"](runner)
    latched.add(np.concatenate(runner.rows).ravel()[-20:], runner.settings[0])
    assert latched.sentence(faults.ESTOP) == latched.sentence(faults.POSITION) == ""


@pytest.mark.parametrize("name", FAULTS)
def test_haptic_status_tells_a_fault_in_its_words_and_what_else_a_node_says_as_it_is(name):
    def shown(**values):
        said = {"haptic_driver": Status(0, 2, "its own words", values)}
        node = SimpleNamespace(get_namespace=lambda: "/haptic")
        client = SimpleNamespace(statuses=said, heard={"haptic_driver": time.monotonic()}, node=node)
        return newest(client)["haptic_driver"]["message"]

    assert shown(fault=name, fault_detail="1 m") == what_to_do(name, "1 m", TYPE)
    assert shown(fault="") == shown(fault="of a newer driver") == shown() == "its own words"


@pytest.mark.parametrize("name", FAULTS)
def test_page_and_terminal_tell_the_same_cause_and_differ_in_what_to_press(name):
    fault = FAULTS[name]
    assert fell(name, "1 m") == f"{fault.title} (fault {name}): {fault.cause}; 1 m"
    assert cause(name) == fault.cause and what_to_do(name).startswith(f"{fell(name)}. ")
    assert steps(name).lower().startswith(fault.first) and steps(name).lower().endswith(f"{PRESS.lower()}.")
    assert what_to_do(name, last=TYPE).lower().endswith("press r and e in haptic status.")
    assert what_to_do(name).lower().endswith("start again.")  # the nodes are gone
    assert "~/" not in what_to_do(name)
