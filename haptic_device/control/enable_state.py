# SPDX-License-Identifier: Apache-2.0
"""Engaging: forces rise over a set time, and only after the wanted force has been small."""

from haptic_device.jit import kernel

IDLE, WAITING, ENGAGING, ENGAGED, FAULT = range(5)
STATES = ("idle", "waiting for a small force", "engaging", "engaged", "fault")
ENABLE, ESTOP, CLUTCH, UNATTENDED, RESET = 1, 2, 4, 8, 16  # the command word: flags, then resets in steps of RESET


@kernel
def engage_state(state, enabled, faulted, small, factor):
    """Next state from the present one; small: the wanted force is small enough; factor is the present rise 0…1."""
    if faulted:
        return FAULT
    if not enabled:
        return IDLE
    if state in (IDLE, FAULT):
        return WAITING
    if state == WAITING:
        return ENGAGING if small else WAITING
    return ENGAGED if factor >= 1.0 else ENGAGING


@kernel
def engage_factor(state, factor, period, time):
    """Factor 0…1 on every force for this tick: zero unless engaging or engaged, rising over time [s]."""
    if state in (ENGAGING, ENGAGED):
        return min(1.0, factor + period / time)
    return 0.0
