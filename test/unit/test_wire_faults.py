# SPDX-License-Identifier: Apache-2.0
"""Each fault of the wire, from either end, on a servo that presses a wall over an open link, in made-up time: the
device's motors are at zero in the time that the document states, and stay so, and one sentence says why."""

import re

import pytest
from lockstep_link import AT_ONCE
from wire_faults import DEVICE, HOST, NUMBERS, Wire

from haptic_device.control import faults
from haptic_device.nodes.bridge import clock_trouble
from haptic_device.nodes.fault_detail import LatchedFault

AFTER = 60_000_000  # [ns] for which the motors stay at zero


def test_there_are_42_faults_that_a_device_meets_and_24_that_a_host_meets():
    assert [len({row.what for row in rows}) for rows in (DEVICE, HOST)] == [len(DEVICE), len(HOST)] == [42, 24]


@pytest.mark.parametrize("row", [*DEVICE, *HOST], ids=lambda row: f"{('device', 'host')[row.way]}: {row.what}")
def test_a_fault_of_the_wire_leaves_no_torque_after_its_time_and_has_one_sentence(row):
    wire = Wire(row.datagrams)
    wire.row, wire.log = row, []
    wire.run((row.within + AFTER) * 1e-9)
    zero = wire.right[row.way] + AT_ONCE.shortest + row.within
    assert any(any(motors) for _, motors in wire.log)
    assert not [(now - zero, motors) for now, motors in wire.log if now > zero and any(motors)]
    latched = LatchedFault("udp" if row.datagrams else "serial", lambda: 0.015)
    latched.add(wire.trace(), wire.settings[0])
    assert faults.name_of(wire.fault) == row.fault
    assert re.fullmatch(NUMBERS.get(row.fault, ""), latched.sentence(wire.fault))
    told = clock_trouble(wire.codec.state, wire.now)
    assert told.startswith("the device's ") if row.fault == "device_clock" else told == ""
    wire.close()
