# SPDX-License-Identifier: Apache-2.0
"""The exchange loop straight on librcl: serialized bytes in and out without Python, untouched by a busy interpreter.

It knows ROS as five C functions and the addresses of a publisher and a subscription, nothing of messages or nodes.
"""

import ctypes
from typing import NamedTuple

import llvmlite.binding
import numpy as np
from numba import types

from haptic_device.jit import kernel
from haptic_device.realtime import answer_looks, atomic, clock, exchange_step

ROOM = 65536  # bytes for a message that comes in; librcl makes it larger for a larger one
MOST = 64  # messages taken at a look: a flood that never ends must not hold up the handle samples

_address = types.uintp
_publish = types.ExternalFunction("rcl_publish_serialized_message", types.int32(_address, _address, _address))
_take = types.ExternalFunction("rcl_take_serialized_message", types.int32(_address, _address, _address, _address))
_memcpy = types.ExternalFunction("memcpy", _address(_address, _address, _address))


class _Allocator(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero_allocate", "state")]


def load_library():
    """Makes librcl's functions known to compiled code. Raises OSError where ROS 2 is not to be found."""
    for name in ("librcutils.so", "librcl.so"):
        ctypes.CDLL(name, ctypes.RTLD_GLOBAL)
        llvmlite.binding.load_library_permanently(name)


def incoming_buffer():
    """rcutils_uint8_array_t for received bytes, as int64: buffer, length, capacity, allocator; owned by librcl."""
    library = ctypes.CDLL("librcutils.so")
    library.rcutils_get_default_allocator.restype = _Allocator
    allocator = library.rcutils_get_default_allocator()
    words = np.zeros(8, np.int64)
    if library.rcutils_uint8_array_init(
        ctypes.c_void_p(words.ctypes.data), ctypes.c_size_t(ROOM), ctypes.byref(allocator)
    ):
        raise MemoryError("librcutils gave no room for incoming messages")
    return words


def outgoing_buffer(data):
    """The same for bytes that numpy owns; never resized."""
    return np.array([data.ctypes.data, data.size, data.size, 0, 0, 0, 0, 0], np.int64)


def free(words):
    """Gives an incoming buffer back."""
    ctypes.CDLL("librcutils.so").rcutils_uint8_array_fini(ctypes.c_void_p(words.ctypes.data))


class Line(NamedTuple):
    """Addresses of rcl entities, the buffers above, where numbers lie in them, and the handle samples' period [ns]."""

    publisher: int
    subscription: int
    inbox: np.ndarray
    outbox: np.ndarray
    frame: exchange_step.Frame
    period: int


class Mails(NamedTuple):
    """Words of the servo's mailboxes: the exchange reads the first two, and writes the last."""

    row: np.ndarray
    gains: np.ndarray
    tool: np.ndarray


class Records(NamedTuple):
    """What the exchange knows of each mailbox, a record of each."""

    row: np.ndarray
    gains: np.ndarray
    tool: np.ndarray


class Near(NamedTuple):
    """Where local contacts come in, where their numbers lie, and the servo's mailbox and the record for them."""

    subscription: int
    frame: exchange_step.NearFrame
    mail: np.ndarray
    record: np.ndarray


@kernel
def run_exchange(line, state, watch, mails, records, near):
    """Sends a handle sample each period and takes what comes in between, until watch[STOP]; returns samples sent.

    Each row of the servo is sent once: where it has no new one yet, the sample waits for it.

    near: None without local contacts, and nothing of theirs is compiled.
    """
    scratch, frame, inbox, period = np.zeros(2, np.int64), line.frame, line.inbox, line.period
    deadline = clock.now_ns(scratch)
    # a set of local contacts comes behind the answer, and nobody says when
    idle = answer_looks.IDLE if near is None else answer_looks.POLL
    while atomic.load(watch, exchange_step.STOP) == 0:
        now = clock.now_ns(scratch)
        if now >= deadline and exchange_step.next_handle(
            frame, state, mails.row, mails.gains, records.row, records.gains, scratch
        ):
            deadline += period * (1 + (now - deadline) // period)  # by whole periods: what was missed is left out
            _publish(line.publisher, line.outbox.ctypes.data, 0)
            watch[exchange_step.SENT] += 1
        # all that wait, oldest first: one that is refused hides no answer behind or before it
        for _ in range(MOST):
            if _take(line.subscription, inbox.ctypes.data, 0, 0) != 0:
                break
            size = inbox[1]  # of what came; what is longer than ours is refused by its size, and cut here
            _memcpy(frame.incoming.ctypes.data, inbox[0], min(size, frame.incoming.size))
            exchange_step.take_in(
                frame, size, state[0], watch, records.gains[0], records.tool, mails.tool, clock.now_ns(scratch)
            )
        if near is not None:
            for _ in range(MOST):
                if _take(near.subscription, inbox.ctypes.data, 0, 0) != 0:
                    break
                size = inbox[1]
                _memcpy(near.frame.incoming.ctypes.data, inbox[0], min(size, near.frame.incoming.size))
                exchange_step.take_in_contacts(near.frame, size, state[0], watch, near.record, near.mail)
        now = clock.now_ns(scratch)
        look = exchange_step.look_after(state[0], now, idle)
        # a deadline that has passed: the servo has no new row
        clock.sleep_until(min(look, deadline if deadline > now else now + answer_looks.POLL), scratch)
    return watch[exchange_step.SENT]
