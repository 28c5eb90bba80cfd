# SPDX-License-Identifier: Apache-2.0
"""The device's side of the exchange: handle samples out at a fixed rate, tool samples in, the latest one counts.

A thread of its own, without the GIL, beside the servo: it reads the servo's newest row, and leaves the tool sample that
counts under a sequence lock. How bytes come and go: realtime/exchange_loop.py.
"""

from typing import NamedTuple

import numpy as np

from haptic_device.control import contact_model, exchange_samples
from haptic_device.jit import kernel, njit
from haptic_device.message_fields import COMMON, EACH, LOCAL_CONTACT, MOST
from haptic_device.realtime import answer_looks, atomic, clock, seqlock

STOP, SENT, ANSWERED, REFUSED, SEEN, UNSEEN, WATCHES = 0, 1, 2, 3, 16, 17, 32
# words of the watch: refusals by reason from REFUSED on, of local contacts from UNSEEN on
REMEMBERED = 4096  # handle samples whose time is known when they are answered
SILENCE = 100_000_000  # [ns] after which another simulation may take over

SHARED = len(COMMON)  # columns that say something of the whole set, the same in each row

STATE = np.dtype(
    [(name, "f8") for name in ("session", "sequence", "method", "axes", "peer_session", "peer_answered")]
    + [(name, "f8") for name in ("near_session", "near_answered", "near_scene")]
    + [("peer_accepted", "i8"), ("clock_offset", "i8"), ("told", "f8"), ("sent", "i8", (REMEMBERED,))]
    + [("composed", "i8", (REMEMBERED,)), ("turns", "i8"), ("round_trip", "i8", (REMEMBERED,))]
    # when to look for answers (answer_looks): the last look, the law's time, and whether it goes by that
    + [(name, "i8") for name in ("looked", "first_look", "in_time")]
)


class Frame(NamedTuple):
    """Where the numbers lie in a message of fixed layout, and its bytes for either direction.

    outgoing, incoming: uint8, aligned so that the numbers are; reals and received: views on them, the sample as
    control/exchange_samples has it; stamp: view on outgoing; fixed: 1 where a byte must be as in the template.
    """

    outgoing: np.ndarray
    reals: np.ndarray
    stamp: np.ndarray
    incoming: np.ndarray
    received: np.ndarray
    template: np.ndarray
    fixed: np.ndarray


class NearFrame(NamedTuple):
    """The same for `local_contacts`: rows (MOST) of LOCAL_CONTACT and numbers (MOST, columns) are views on incoming."""

    incoming: np.ndarray
    rows: np.ndarray
    numbers: np.ndarray
    template: np.ndarray
    fixed: np.ndarray


def make_near_frame(template, fixed, offset):
    """NearFrame for a message with this template, mask of fixed bytes, and offset of its first number."""
    room = np.zeros(len(template) + 16, np.uint8)
    start = -(room.ctypes.data + offset) % 8
    incoming = room[start : start + len(template)]
    rows = incoming[offset : offset + MOST * LOCAL_CONTACT.itemsize].view(LOCAL_CONTACT)
    numbers = rows.view(np.float64).reshape(MOST, len(COMMON + EACH))
    return NearFrame(incoming, rows, numbers, np.array(template), np.ascontiguousarray(fixed, np.uint8))


def make_frame(template, fixed, offsets, count):
    """Frame for a message with these template bytes, mask of fixed bytes, and offsets of its three arrays.

    These are equally long, so that each begins as far behind the one before.
    """
    size = len(template)
    outgoing, incoming = _aligned(size), _aligned(size)
    outgoing[:] = np.frombuffer(template, np.uint8)
    strides = offsets[1] - offsets[0], 8
    reals, received = (np.ndarray((3, count), np.float64, of, offsets[0], strides) for of in (outgoing, incoming))
    fixed = np.ascontiguousarray(fixed, np.uint8)
    return Frame(outgoing, reals, outgoing[4:12].view(np.int32), incoming, received, outgoing.copy(), fixed)


def _aligned(size):
    """uint8 array whose fifth byte lies on an 8-byte boundary."""
    room = np.zeros(size + 16, np.uint8)
    start = -(room.ctypes.data + 4) % 8
    return room[start : start + size]


@kernel
def compose_handle(frame, state, row, gains, scratch):
    """Writes the next handle sample into frame.outgoing, from the servo's newest row."""
    axes, position, velocity, effort = int(state.axes), frame.reals[0], frame.reals[1], frame.reals[2]
    state.in_time = 1 if is_answered(state) else 0
    state.sequence += 1.0  # a float64, as all in the message: whole numbers up to 2**53, which no session reaches
    state.sent[int(state.sequence) % REMEMBERED] = np.int64(row.deadline)
    state.composed[int(state.sequence) % REMEMBERED] = clock.now_ns(scratch)
    for i in range(axes):
        position[i], velocity[i], effort[i] = row.position[i], row.velocity[i], row.exchange_effort[i]
    tail = position[axes:]
    tail[exchange_samples.LAYOUT] = exchange_samples.LAYOUT_VERSION
    tail[exchange_samples.SESSION], tail[exchange_samples.SEQUENCE] = state.session, state.sequence
    tail[exchange_samples.ANSWERED_SESSION], tail[exchange_samples.ANSWERED] = state.peer_session, row.tool_sequence
    tail[exchange_samples.METHOD], tail[exchange_samples.GAINS] = state.method, gains.hash
    tail[exchange_samples.GAIN_0], tail[exchange_samples.GAIN_0 + 1] = gains.stiffness, gains.damping
    tail[exchange_samples.GAIN_0 + 2] = gains.rotational_stiffness
    tail[exchange_samples.GAIN_0 + 3] = gains.rotational_damping
    for i in range(axes):
        effort[axes + exchange_samples.GAIN_0 + i] = gains.limit[i]
    tail[exchange_samples.CONTACT], tail[exchange_samples.ENERGY] = 0.0, row.exchange_energy
    stamp = np.int64(row.deadline) + state.clock_offset
    frame.stamp[0], frame.stamp[1] = stamp // 1_000_000_000, stamp % 1_000_000_000


@kernel
def next_handle(frame, state, row_mail, gains_mail, row, gains, scratch):
    """Composes the next handle sample from the servo's newest row; False if that is told already, or there is none.

    Records of one.
    """
    if atomic.collect(row_mail, 0, seqlock.FIRST, atomic.words_of(row)) <= 0 or row[0].deadline <= state[0].told:
        return False
    state[0].told = row[0].deadline
    known = atomic.words_of(gains)
    atomic.collect_whole(gains_mail, 0, seqlock.FIRST, np.empty_like(known), known)
    compose_handle(frame, state[0], row[0], gains[0], scratch)
    return True


@kernel
def take_in(frame, size, state, watch, gains, tool, tool_mail, now):
    """Judges the message of `size` bytes in frame.incoming; accepted, it becomes the tool sample that counts."""
    verdict = _judge(frame, size, state, gains, now)
    if verdict != exchange_samples.ACCEPTED:  # counted by reason; what counted before goes on to count
        watch[REFUSED + verdict] += 1
        return verdict
    watch[ANSWERED] += 1
    axes, position, velocity, effort = int(state.axes), frame.received[0], frame.received[1], frame.received[2]
    tail = position[axes:]
    record = tool[0]
    record.session, record.sequence = tail[exchange_samples.SESSION], tail[exchange_samples.SEQUENCE]
    record.answered = tail[exchange_samples.ANSWERED]
    record.sent = state.sent[int(tail[exchange_samples.ANSWERED]) % REMEMBERED]
    record.contact, record.energy = tail[exchange_samples.CONTACT], tail[exchange_samples.ENERGY]
    record.handle_sequence = state.sequence
    for i in range(axes):
        record.position[i], record.velocity[i], record.effort[i] = position[i], velocity[i], effort[i]
    state.peer_session, state.peer_answered, state.peer_accepted = record.session, record.answered, now
    composed = state.composed[int(record.answered) % REMEMBERED]
    state.round_trip[state.turns % REMEMBERED] = now - composed
    state.turns += 1
    if is_answered(state) and state.in_time:
        state.first_look = answer_looks.first_after(state.first_look, state.looked < composed + state.first_look)
    atomic.publish(tool_mail, 0, seqlock.FIRST, atomic.words_of(tool))
    return verdict


@njit
def is_answered(state):
    """Whether the newest handle sample has its answer."""
    return state.peer_answered == state.sequence


@njit
def look_after(state, now, idle):
    """Remembers a look at `now` [ns]; returns the time of the next, at most `idle` [ns] later while nothing is due."""
    state.looked = now
    if is_answered(state):
        return now + idle
    sent = state.composed[int(state.sequence) % REMEMBERED]
    return answer_looks.next_look(now, sent, state.first_look, state.in_time != 0)


@njit
def _judge(frame, size, state, gains, now):
    if size != frame.template.size:
        return exchange_samples.OTHER_NAMES
    for i in range(size):
        if frame.fixed[i] != 0 and frame.incoming[i] != frame.template[i]:
            return exchange_samples.OTHER_NAMES
    sample, axes = frame.received, int(state.axes)
    peer = exchange_samples.Peer(state.peer_session, state.peer_answered, state.peer_accepted)
    verdict = exchange_samples.judge_tool(
        sample, axes, peer, state.session, state.sequence, state.method, gains.hash, now, SILENCE
    )
    # its time would be another sample's: the ring of times has gone round since
    forgotten = sample[0, axes + exchange_samples.ANSWERED] <= state.sequence - REMEMBERED
    return exchange_samples.OLD if verdict == exchange_samples.ACCEPTED and forgotten else verdict


@kernel
def take_in_contacts(frame, size, state, watch, near, near_mail):
    """Judges the `local_contacts` of `size` bytes in frame.incoming; accepted, they are the set that counts."""
    verdict = _judge_contacts(frame, size, state)
    if verdict != contact_model.ACCEPTED:
        watch[UNSEEN + verdict] += 1
        return verdict
    watch[SEEN] += 1
    head, record = frame.rows[0], near[0]
    state.near_session, state.near_scene, state.near_answered = head.session, head.scene, head.answered
    record.number, record.sent = head.answered, state.sent[int(head.answered) % REMEMBERED]
    record.session, record.sequence = head.session, head.sequence
    record.answered_session, record.answered = head.answered_session, head.answered
    record.scene, record.offered, record.trust = head.scene, head.offered, head.trust
    record.mass, record.inertia, record.extent = head.mass, head.inertia, head.extent
    record.gravity_x, record.gravity_y = head.gravity_x, head.gravity_y
    record.tool_pose_x, record.tool_pose_y = head.tool_pose_x, head.tool_pose_y
    record.tool_pose_theta = head.tool_pose_theta
    for i in range(MOST):
        for k in range(record.table.shape[1]):
            record.table[i, k] = frame.numbers[i, SHARED + k]
    atomic.publish(near_mail, 0, seqlock.FIRST, atomic.words_of(near))
    return verdict


@njit
def _judge_contacts(frame, size, state):
    if size != frame.template.size:
        return contact_model.OTHER_LAYOUT
    for i in range(size):
        if frame.fixed[i] != 0 and frame.incoming[i] != frame.template[i]:
            return contact_model.OTHER_LAYOUT
    for k in range(SHARED):  # NaN fails any comparison, so the test is for what is good
        if not abs(frame.numbers[0, k]) < 1e15:
            return contact_model.NOT_FINITE
    head = frame.rows[0]
    if head.session != state.peer_session:  # of the simulation whose tool sample counts, or of none
        return contact_model.OTHER_SENDER
    answered, known = head.answered, state.sequence - REMEMBERED
    if head.answered_session != state.session or not known < answered <= state.sequence or answered < 1.0:
        return contact_model.NOT_MINE
    if head.session == state.near_session and answered <= state.near_answered:
        return contact_model.OLD
    if head.session == state.near_session and head.scene < state.near_scene:
        return contact_model.OTHER_SCENE
    if not (head.mass > 0.0 and head.inertia > 0.0 and head.trust >= 0.0):
        return contact_model.NOT_A_CONTACT
    return contact_model.judge_table(frame.numbers[:, SHARED:])
