# SPDX-License-Identifier: Apache-2.0
"""One servo tick: the stages of the table "Servo" in docs/theory/model.md, in its order."""

import math

import numpy as np

from haptic_device.control import (
    account,
    actuation_delay,
    enable_state,
    exchange_controller,
    fault_watch,
    faults,
    linkage,
    motor,
    rows,
    sensing,
    wishes,
    withheld,
)
from haptic_device.control.records import AXES, OUTPUT
from haptic_device.jit import kernel, njit

CLEARED = np.zeros(1, OUTPUT)


@kernel
def tick(settings, state, tick):
    """One tick: records of SETTINGS, STATE and TICK (control/records); reads its sensors and tool, fills in its output.

    Nothing of the output's last content counts.
    """
    tick.output = CLEARED[0]
    sensors, tool, output = tick.sensors, tick.tool, tick.output
    motion, hold, enable, fault, book = state.motion, state.hold, state.enable, state.fault, state.account
    # what has been
    sensing.sense(settings, motion, state.samples, state.compensation, fault, sensors, output)
    actuation_delay.was_written(settings, hold, sensors)
    known = motion.stale_ticks == 0.0
    account.book(settings, book, state.rows, rows.WALLS + int(state.change.walls), hold, motion, sensors)
    # what is wanted; on old counts nobody knows where the handle is, so nothing moves
    if known:
        exchange_controller.wish(settings, state, tool, output)
        wishes.wish(settings, state, output)
        wishes.tell_forces(settings, state, state.wished, output)
    else:
        exchange_controller.stay(settings, state, output)
        wishes.tell_forces(settings, state, state.rows, output)
    # whether it may be
    for i in range(AXES):
        if not abs(output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]) < math.inf:
            fault_watch.latch(fault, faults.NOT_A_NUMBER)  # before any limit, which would make a force of it
    fault_watch.watch(settings, fault, enable, motion, sensors)
    near = enable.state != enable_state.WAITING or output.exchange_fade == 0.0
    near = near or exchange_controller.tool_is_near(settings, tool, output.position)
    enable_state.advance(settings, enable, fault, motion, sensors, near, output)
    # what will be held until the next tick
    share = 1.0
    if known:
        motor.limits(settings, enable, hold)
        wishes.weigh_in(settings, state, output, hold.limit)
        share, state.change.share = wishes.move(settings, state, enable.ramp == 0.0)
        account.settle(settings, book, hold, hold.limit)
        account.forgive(settings, book, state.exchange)
        enable_state.wait(enable, state.change.share, output)
    else:
        wishes.rest(state, enable.ramp == 0.0)
    exchange_controller.moved(settings, state, share, tool, output)
    wishes.tell_forces(settings, state, state.rows, output)
    motor.command(settings, enable, fault, hold, book, output)
    hold.deadline = sensors.deadline
    actuation_delay.send(hold, book)
    for i in range(AXES):
        output.exchange_effort[i] = output.force_coupling[i]
    exchange_controller.spoil(tool, output)
    _tell_energy(settings, book, motion.jacobian, output)
    withheld.tell(settings, state, sensors, tool, output)


@njit
def _tell_energy(settings, book, jacobian, output):
    """What the account knows, and the damping left over that it counts with, into the output."""
    for i in range(AXES):
        output.energy_given[i], output.margin[i] = book.energy_given[i], settings.passivity.margin[i]
        output.surplus[i] = settings.passivity.surplus[i]
    joints = settings.port.joints
    if joints > 0.0 and linkage.determinant(jacobian, joints) != 0.0:  # at this pose, of what is in force
        felt = linkage.felt_damping(jacobian, joints, settings.port.damping)
        for i in range(int(joints)):
            output.margin[i] = felt * book.left[i] / settings.port.damping[i]
    output.stored, output.promised = book.stored, book.late
    output.lateness_least, output.lateness_counted = settings.port.least, settings.port.most
    output.lateness_ratio = settings.port.ratio
