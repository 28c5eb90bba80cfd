# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange: bytes of the handle in, bytes of the tool out; no ROS."""

from typing import NamedTuple

BUDGET = 1.0
"""Most energy [J] the tool port may supply before any has been shipped, and keep: as much as a pull needs that the
device holds (haptic_sim/exchange/port.py, PspmPort). What is over goes back to the device."""


class Limits(NamedTuple):
    """Of what the device's samples make of the force on the tool: force [N], torque [N m], change of force [N/s]."""

    force: float = 20.0
    torque: float = 1.0
    slew: float = 2000.0


LIMITS = Limits()
