# SPDX-License-Identifier: Apache-2.0
"""Engaging: forces rise over a set time, and only after the wanted force has been small."""

import math

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
def force_ramp(state, factor, period, time):
    """Factor 0…1 on every force for this tick: zero unless engaging or engaged, rising over time [s]."""
    if state in (ENGAGING, ENGAGED):
        return min(1.0, factor + period / time)
    return 0.0


@kernel
def advance(settings, enable, fault, motion, sensors, near, output):
    """State and force ramp of this tick, from the command word and the force that is wanted.

    near: whether the tool, if the coupling pulls to it at all, pulls little though its samples are not old.
    """
    command, limits = int(sensors.command), settings.engage
    enabled = (command & ENABLE) != 0 and (command & CLUTCH) == 0
    wanted_x = output.force_walls[0] + output.force_coupling[0]
    wanted_y = output.force_walls[1] + output.force_coupling[1]
    # nobody is pushed by what stood there before: engaging waits for a small force
    small = math.hypot(wanted_x, wanted_y) < limits.force and abs(output.force_coupling[2]) < limits.torque and near
    enable.state = engage_state(int(enable.state), enabled, fault.code != 0.0, small, enable.ramp)
    enable.ramp_before = enable.ramp
    ramp = force_ramp(int(enable.state), enable.ramp, settings.period, limits.time)
    enable.ramp = min(ramp, enable.ramp) if motion.stale_ticks > 0.0 else ramp  # nothing rises on old counts
    output.engage = enable.ramp


@kernel
def wait(enable, share, output):
    """Forces rise no faster than what all but the coupling gains by it is paid: by this share of a tick's rise."""
    if enable.ramp > enable.ramp_before:
        enable.ramp = output.engage = enable.ramp_before + share * (enable.ramp - enable.ramp_before)
