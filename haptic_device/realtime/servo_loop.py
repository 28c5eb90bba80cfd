# SPDX-License-Identifier: Apache-2.0
"""One cycle, two clocks: the same tick by the computer's clock against a link, or in lock-step against the plant."""

import functools

import numba
import numpy as np
from numba import types

from haptic_device.control import contact_model, enable_state, servo, virtual_tool
from haptic_device.jit import kernel, njit
from haptic_device.realtime import atomic, clock, hardware_interface, seqlock

STOP, COMMAND, RUNNING, LATE_DEVICE, TORN, ATTENDED, CONTROLS = 0, 1, 2, 3, 4, 5, 8  # words of control

# what the servo takes of the tool sample that counts now; the exchange writes it
TOOL = np.dtype(
    [
        (name, "f8", (3,)) if name in ("position", "velocity", "effort") else (name, "f8")
        for name in (
            "session",
            "sequence",
            "answered",
            "sent",
            "position",
            "velocity",
            "effort",
            "contact",
            "energy",
            "handle_sequence",
        )
    ]
)

_WORDS = types.int64[::1]


def _records(dtype):
    return types.Array(numba.from_dtype(dtype), 1, "C")


def _signature(memory):
    return types.int64(
        types.FunctionType(hardware_interface.READ),
        types.FunctionType(hardware_interface.WRITE),
        *(_WORDS, _WORDS, _WORDS, _WORDS, _WORDS, _WORDS, _WORDS),
        *map(_records, (servo.SETTINGS, memory, servo.TICK, TOOL, contact_model.SET)),
    )


def run_realtime(
    read,
    write,
    memory_of_link,
    control,
    settings_mail,
    tool_mail,
    near_mail,
    row_mail,
    ring,
    settings,
    memory,
    rows,
    tool,
    near,
):
    """The servo by CLOCK_MONOTONIC until control[STOP]; every way out writes zero to the motor. Returns missed ticks.

    rows: the trace ring's rows and one more, which is used while the ring is full. settings, memory, tool, near: one
    record each. Nothing here allocates, locks or calls Python.
    """
    scratch, sample = np.zeros(2, np.int64), np.zeros(hardware_interface.SAMPLE)
    zero, motor = np.zeros(3), np.zeros(3)
    settings_words, tool_words = atomic.words_of(settings), atomic.words_of(tool)
    settings_staged, tool_staged = np.empty_like(settings_words), np.empty_like(tool_words)
    near_words, near_turn = atomic.words_of(near), -1
    near_staged = np.empty_like(near_words)
    tool_turn, missed, compute, delay, number = -1, 0, 0.0, 0.0, 0
    settings_turn = _take(control, settings_mail, settings_staged, settings_words, -1)
    period = np.int64(round(settings[0].period * 1e9))
    deadline = clock.now_ns(scratch) + period
    write(memory_of_link, deadline - period, deadline, period, 0, zero)
    fresh = np.int64(1)
    atomic.store(control, ATTENDED, deadline)
    atomic.store(control, RUNNING, 1)
    while atomic.load(control, STOP) == 0:
        clock.sleep_until(deadline, scratch)
        woke = clock.now_ns(scratch)
        late = (woke - deadline) // period
        missed, deadline = missed + late, deadline + late * period
        patience = period // 2 if fresh else period // 16  # a device that is gone must not keep the processor busy
        fresh = read(memory_of_link, deadline, deadline + patience, sample)
        began = clock.now_ns(scratch)
        slot = seqlock.ring_slot(ring, rows.size - 1)
        row = rows[slot if slot >= 0 else rows.size - 1]
        settings_turn = _take(control, settings_mail, settings_staged, settings_words, settings_turn)
        tool_turn = _take(control, tool_mail, tool_staged, tool_words, tool_turn)
        near_known = near_turn
        near_turn = _take(control, near_mail, near_staged, near_words, near_turn)
        if near_turn != near_known and near[0].number > 0.0:
            virtual_tool.take(memory[0], near[0])
        row.tick, row.deadline, row.missed, row.compute = number, deadline, missed, compute
        row.write_delay = delay
        row.lateness = (woke - deadline + late * period) * 1e-9
        row.command = _command(control, settings[0].unattended, deadline)
        fill_inputs(row, settings[0], tool[0], sample, fresh)
        fill_contacts(row, memory[0])
        servo.tick(settings[0], memory[0], row)
        for i in range(servo.AXES):
            motor[i] = row.motor[i]
        written = clock.now_ns(scratch)
        write(memory_of_link, written, deadline + period, period, np.int64(row.state == enable_state.ENGAGED), motor)
        atomic.publish(row_mail, 0, seqlock.FIRST, row_words(rows, slot))
        if slot >= 0:
            seqlock.ring_push(ring)
        control[LATE_DEVICE] += 1 - fresh
        delay = (written - deadline) * 1e-9
        compute = (clock.now_ns(scratch) - began) * 1e-9
        number, deadline = number + 1, deadline + period
    write(memory_of_link, clock.now_ns(scratch), deadline, period, 0, zero)
    atomic.store(control, RUNNING, 0)
    return missed


@functools.cache
def realtime(memory):
    """run_realtime compiled for this dtype of memory, and links given as function pointers.

    So any link runs the same cached machine code.
    """
    return kernel(_signature(memory))(run_realtime)


@njit
def _command(control, unattended, now):
    """The command word; UNATTENDED is added where nobody has said for `unattended` [s] that he is there (0: never).

    Only where the motor may move: a node that was not enabled needs nobody to stop it.
    """
    word = atomic.load(control, COMMAND)
    alone = unattended > 0.0 and now - atomic.load(control, ATTENDED) > unattended * 1e9
    return word | enable_state.UNATTENDED if alone and word & enable_state.ENABLE else word


@kernel
def row_words(rows, slot):
    index = slot if slot >= 0 else rows.size - 1
    return atomic.words_of(rows[index : index + 1])


@njit
def _take(control, mail, staged, words, known):
    """The latest record of a mailbox into words if it is not the known one; returns which is known now.

    One that its writer does not leave alone waits for the next tick, and is counted.
    """
    if atomic.load(mail, 0) == known:
        return known
    turn = atomic.collect_whole(mail, 0, seqlock.FIRST, staged, words)
    control[TORN] += turn < 0
    return turn if turn >= 0 else known


@njit
def fill_inputs(row, settings, tool, sample, fresh):
    """The tick's inputs from the device's sample and the tool sample that counts; deadline is in the row already."""
    row.parameter_version, row.latched = settings.version, sample[hardware_interface.LATCHED]
    row.device_status = sample[hardware_interface.STATUS] + fresh
    row.tool_session, row.tool_sequence, row.tool_answered = tool.session, tool.sequence, tool.answered
    row.tool_age = (row.deadline - tool.sent) * 1e-9 if tool.sequence > 0.0 else -1.0
    row.tool_contact, row.tool_energy = tool.contact, tool.energy
    row.handle_sequence = tool.handle_sequence
    for i in range(servo.AXES):
        row.counts[i], row.drag[i] = sample[hardware_interface.COUNTS + i], sample[hardware_interface.DRAG + i]
        row.tool_position[i], row.tool_velocity[i] = tool.position[i], tool.velocity[i]
        row.tool_effort[i] = tool.effort[i]


@kernel
def fill_contacts(row, memory):
    """Which set of local contacts counts in this tick, and its age [s]; −1: none yet."""
    row.contact_set = memory.near_number
    row.contact_age = (row.deadline - memory.near_sent) * 1e-9 if memory.near_number > 0.0 else -1.0
