# SPDX-License-Identifier: Apache-2.0
"""The clutch and the books: the handle's way until the tick that opens it is the handle's."""

import numpy as np
import pytest
from exchange_systems import one_axis
from ticks import tick

from adversary import exchange_search as adversary
from haptic_device.control import enable_state, faults, virtual_coupling

PERIOD, SPEED, FORCE, TIMES = 1e-3, 0.3, 8.0, 8  # [s], [m/s], [N] of the coupling, clutchings
STIFFNESS, DAMPING, BUDGET = 1000.0, 0.25, 0.005
OPEN = enable_state.ENABLE | enable_state.CLUTCH


class Led:
    """A handle led by hand against a tool that stands where the handle began; forged [J]: books above the truth."""

    def __init__(self, method):
        self.settings = one_axis(method, STIFFNESS, DAMPING, PERIOD, over=1.5, engage__time=0.01, engage__force=100.0)
        (self.memory, self.row), self.place, self.given, self.number = adversary.engaged(), 0.0, 0.0, 0
        self.forged = -np.inf
        self.lead(0.0)

    def lead(self, way, command=enable_state.ENABLE):
        """One tick, at whose end the handle has gone this way [m] since the last one."""
        row, damping = self.row[0], float(self.settings["hardware"]["damping"][0, 0])
        # the work of the motor, less the least that the damper takes
        self.given += float(row["force_on_handle"][0]) * way - damping * way * way / PERIOD
        self.place, self.number = self.place + way, self.number + 1
        row["latched"] = row["deadline"] = self.number * PERIOD * 1e9
        row["command"], row["device_status"], row["counts"][0] = command, faults.FRESH, round(self.place * 1e9)
        row["tool_session"], row["tool_age"] = 1.0, 0.0
        row["tool_sequence"] = row["tool_answered"] = self.number
        tick(self.settings, self.memory, self.row)
        self.forged = max(self.forged, self.given + self.books())
        return row

    def books(self):
        """Energy [J] in tank, spring and shipped, less the budget."""
        memory, row = self.memory[0], self.row[0]
        spring, tank = memory["spring"], memory["tank"]
        stretch = row["coupling_position"][0] - row["position"][0]
        stored = virtual_coupling.spring_store(spring["stiffness"][0], spring["limit"][0], stretch)
        return float(tank["level"] + stored + tank["shipped"] - tank["returned"]) - BUDGET


@pytest.mark.parametrize("toward", [-1.0, 1.0])
@pytest.mark.parametrize("method", ["pspm", "local"])
def test_eight_clutchings_at_8_newtons_and_300_mm_s_put_no_more_into_the_books_than_the_hand_did(method, toward):
    led = Led(method)
    for _ in range(TIMES):
        pulled = 0
        while abs(led.row[0]["force_on_handle"][0]) < FORCE and pulled < 400:
            led.lead(SPEED * PERIOD)
            pulled += 1
        assert abs(led.row[0]["force_on_handle"][0]) >= FORCE
        # along the force or against it, in the tick that opens the clutch too
        led.lead(toward * SPEED * PERIOD)
        row = led.lead(toward * SPEED * PERIOD, OPEN)
        assert row["force_on_handle"][0] == 0.0
        for _ in range(20):
            led.lead(-SPEED * PERIOD, OPEN)
        for _ in range(30):
            led.lead(0.0)
    assert led.row[0]["engage"] == 1.0
    assert led.forged <= 1e-9
