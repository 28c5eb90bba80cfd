# SPDX-License-Identifier: Apache-2.0
"""What the driver does fifty times a second beside its commands, which a thread of their own takes at any moment."""

from types import SimpleNamespace

import pytest

from haptic_device.law import engage, fault
from haptic_device.node.driver import DriverNode


def watch(servo, heard=True):
    node = SimpleNamespace(
        servo=servo, values={"servo.rate": 1000.0, "auto_enable": False}, _stall=0.0, _watched=0.0, _told=None,
        _say=lambda *words: None, _report=lambda row: None, _commands=SimpleNamespace(running=heard),
    )  # fmt: skip
    DriverNode._watch(node)


def served(row, **given):
    return SimpleNamespace(running=True, realtime="", row=SimpleNamespace(get=lambda: [row]), **given)


@pytest.mark.parametrize("heard", [True, False])
def test_a_driver_whose_commands_nobody_hears_any_more_attends_no_longer(heard):
    attended = []
    watch(served(SimpleNamespace(state=0, fault=0), attend=lambda: attended.append(True)), heard)
    assert attended == [True] * heard


def test_a_fault_that_was_reset_meanwhile_takes_no_new_enable_back():
    orders = []
    row = SimpleNamespace(state=engage.FAULT, fault=fault.ESTOP)  # as it was before reset and enable
    watch(served(row, attend=lambda: None, order=lambda **flags: orders.append(flags)))
    assert orders == []
