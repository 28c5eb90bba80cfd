# SPDX-License-Identifier: Apache-2.0
"""One cycle, two clocks: the same tick by the computer's clock against a link, or in lock-step against the plant."""

import functools
from typing import NamedTuple

import numba
import numpy as np
from numba import types

from haptic_device.control import contact_model, enable_state, faults, servo, tool_contacts
from haptic_device.control.records import AXES, SETTINGS, STATE, TICK, TRACE_ROW
from haptic_device.jit import inlined, kernel, njit
from haptic_device.realtime import atomic, clock, hardware_interface, seqlock

STOP, COMMAND, RUNNING, LATE_DEVICE, TORN, ATTENDED, CONTROLS = 0, 1, 2, 3, 4, 5, 8  # words of control

TOOL = np.dtype(
    [
        *((name, "f8") for name in ("session", "sequence", "answered", "sent")),
        *((name, "f8", (AXES,)) for name in ("position", "velocity", "effort")),
        *((name, "f8") for name in ("contact", "energy", "handle_sequence")),
    ]
)
"""What the servo takes of the tool sample that counts now; the exchange writes it. sent [ns]: of the handle sample."""

_WORDS = types.int64[::1]


def _records(dtype):
    return types.Array(numba.from_dtype(dtype), 1, "C")


class Mails(NamedTuple):
    """Words of the servo's mailboxes; it writes the last alone."""

    settings: np.ndarray
    tool: np.ndarray
    near: np.ndarray
    row: np.ndarray


class Records(NamedTuple):
    """What the servo works in: one record each, and the rows of the ring.

    ticks: copied to the mailbox and into the ring's rows at a tick's end.
    """

    settings: np.ndarray
    state: np.ndarray
    ticks: np.ndarray
    rows: np.ndarray
    tool: np.ndarray
    near: np.ndarray


def _signature():
    # memory first: of a tuple that begins with a function numba says each time that these are experimental
    link = _WORDS, types.FunctionType(hardware_interface.READ), types.FunctionType(hardware_interface.WRITE)
    records = tuple(map(_records, (SETTINGS, STATE, TICK, TRACE_ROW, TOOL, contact_model.SET)))
    mails = types.NamedUniTuple(_WORDS, len(Mails._fields), Mails)
    return types.int64(types.Tuple(link), _WORDS, _WORDS, mails, types.NamedTuple(records, Records))


def run_realtime(link, control, ring, mails, records):
    """The servo by CLOCK_MONOTONIC until control[STOP]; every way out writes zero to the motor. Returns missed ticks.

    link: memory, read and write of a hardware interface, a plain tuple. ring: words. Nothing here allocates, locks or
    calls Python.
    """
    (memory_of_link, read, write), (settings, state, ticks, rows, tool, near) = link, records
    scratch, sample = np.zeros(2, np.int64), np.zeros(hardware_interface.SAMPLE)
    zero, motor = np.zeros(3), np.zeros(3)
    settings_words, tool_words = atomic.words_of(settings), atomic.words_of(tool)
    settings_staged, tool_staged = np.empty_like(settings_words), np.empty_like(tool_words)
    near_words, near_turn, words = atomic.words_of(near), -1, atomic.words_of(ticks)
    tick, sensors = ticks[0], ticks[0].sensors
    near_staged = np.empty_like(near_words)
    tool_turn, missed, compute, delay, number = -1, 0, 0.0, 0.0, 0
    settings_turn = _take(control, mails.settings, settings_staged, settings_words, -1)
    lively = True
    period = np.int64(round(settings[0].period * 1e9))
    deadline = clock.now_ns(scratch) + period
    write(memory_of_link, deadline - period, deadline, period, 0, zero)
    atomic.store(control, ATTENDED, deadline)
    atomic.store(control, RUNNING, 1)
    while atomic.load(control, STOP) == 0:
        clock.sleep_until(deadline, scratch)
        # what has been slept through is missed, and the deadline goes on in whole periods
        woke = clock.now_ns(scratch)
        late = (woke - deadline) // period
        missed, deadline = missed + late, deadline + late * period
        # the device may be late itself; the servo waits for it a little, hardly for one that tells nothing new
        known, patience = sample[hardware_interface.LATCHED], period // 2 if lively else period // 16
        fresh = read(memory_of_link, deadline, deadline + patience, sample)
        lively = fresh == 1 or sample[hardware_interface.LATCHED] > known
        began = clock.now_ns(scratch)
        settings_turn = _take(control, mails.settings, settings_staged, settings_words, settings_turn)
        tool_turn = _take(control, mails.tool, tool_staged, tool_words, tool_turn)
        near_known = near_turn
        near_turn = _take(control, mails.near, near_staged, near_words, near_turn)
        if near_turn != near_known and near[0].number > 0.0:
            tool_contacts.take(state[0].virtual_tool.contacts, near[0])
        sensors.missed, sensors.compute, sensors.write_delay = missed, compute, delay
        sensors.lateness = (woke - deadline + late * period) * 1e-9
        sensors.command = _command(control, settings[0].fault.unattended, deadline)
        run_tick(settings[0], state[0], tool[0], tick, number, deadline, sample, fresh)
        for i in range(AXES):
            motor[i] = tick.output.motor[i]
        # the motor comes before all that is only told
        written = clock.now_ns(scratch)
        engaged = np.int64(tick.output.state == enable_state.ENGAGED)
        write(memory_of_link, written, deadline + period, period, engaged, motor)
        atomic.publish(mails.row, 0, seqlock.FIRST, words)
        # a full ring drops the row; the servo never waits for its reader
        slot = seqlock.ring_slot(ring, rows.size)
        if slot >= 0:
            copy_tick(ticks, rows, slot)
            seqlock.ring_push(ring)
        control[LATE_DEVICE] += 1 - fresh
        delay = (written - deadline) * 1e-9
        compute = (clock.now_ns(scratch) - began) * 1e-9
        number, deadline = number + 1, deadline + period
    # however the loop ends
    write(memory_of_link, clock.now_ns(scratch), deadline, period, 0, zero)
    atomic.store(control, RUNNING, 0)
    return missed


@functools.cache
def realtime():
    """run_realtime, compiled for links given as function pointers: any link runs the same cached machine code."""
    return kernel(_signature())(run_realtime)


@njit
def _command(control, unattended, now):
    """The command word; UNATTENDED is added where nobody has said for `unattended` [s] that he is there (0: never).

    Only where the motor may move: a node that was not enabled needs nobody to stop it.
    """
    word = atomic.load(control, COMMAND)
    alone = unattended > 0.0 and now - atomic.load(control, ATTENDED) > unattended * 1e9
    return word | enable_state.UNATTENDED if alone and word & enable_state.ENABLE else word


@njit
def copy_tick(ticks, rows, at):
    """Copies the one TICK into a row of the trace (TRACE_ROW, the same bytes)."""
    to, words = rows[at : at + 1].view(np.int64), ticks.view(np.int64)
    for i in range(words.size):
        to[i] = words[i]


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


@inlined
def run_tick(settings, state, tool, tick, number, deadline, sample, fresh):
    """The tick of this number and deadline [ns]; sample: SAMPLE of the device, fresh: 1 if it is of this deadline.

    A record of each. missed, compute, lateness, write_delay and command of its sensors are what the caller put there.
    """
    tick.sensors.tick, tick.sensors.deadline, tick.sensors.parameter_version = number, deadline, settings.version
    _fill_sensors(tick.sensors, sample, fresh)
    tick.sensors.stamp_error = max(tick.sensors.stamp_error, settings.hardware.stamp_error * 1e9)
    _fill_tool(tick.tool, tool, state.virtual_tool.contacts, deadline)
    servo.tick(settings, state, tick)


@njit
def _fill_sensors(sensors, sample, fresh):
    """What the device says; of its status word the bits that a device sets, and FRESH, which is ours."""
    sensors.latched, sensors.stamp_error = sample[hardware_interface.LATCHED], sample[hardware_interface.STAMP_ERROR]
    sensors.device_status = (np.int64(sample[hardware_interface.STATUS]) & faults.DEVICE_BITS) | fresh
    for i in range(AXES):
        sensors.counts[i] = sample[hardware_interface.COUNTS + i]
        sensors.drag[i] = sample[hardware_interface.DRAG + i]


@njit
def _fill_tool(sample, tool, contacts, deadline):
    """The tool sample that counts, and which set of local contacts, with their ages [s]; −1: none yet."""
    sample.session, sample.sequence, sample.answered = tool.session, tool.sequence, tool.answered
    sample.age = (deadline - tool.sent) * 1e-9 if tool.sequence > 0.0 else -1.0
    sample.contact, sample.energy, sample.handle_sequence = tool.contact, tool.energy, tool.handle_sequence
    for i in range(AXES):
        sample.position[i], sample.velocity[i], sample.effort[i] = tool.position[i], tool.velocity[i], tool.effort[i]
    sample.contact_set = contacts.number
    sample.contact_age = (deadline - contacts.sent) * 1e-9 if contacts.number > 0.0 else -1.0
