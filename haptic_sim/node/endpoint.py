# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange: bytes of `handle` become a handle sample or a counted refusal, and a tool
sample becomes the bytes of `tool` that answer it.

A device with fewer axes than the plane leaves the others where the scene put the tool.
"""

import secrets
from collections import deque
from typing import NamedTuple

import numpy as np

from haptic_device.control import exchange_samples
from haptic_device.message_fields import COMMON, LOCAL_CONTACT, MOST, exchange_names
from haptic_device.parameters import EXCHANGE_METHODS
from haptic_device.recording.layouts import CloudLayout, JointLayout
from haptic_sim.simulation import HandleSample, Planar, ToolSample

SILENCE_NS = 500_000_000
"""A second device is listened to only after the first has been silent this long."""
LARGEST_WHOLE = 2.0**53 - 1.0
ANSWERS_KEPT = 512
GAINS = slice(exchange_samples.GAIN_0, exchange_samples.GAIN_0 + 4)


class Question(NamedTuple):
    """An accepted handle sample, its number of axes and its tail, and whether its session is new."""

    handle: HandleSample
    axes: int
    tail: tuple[float, ...]
    new_session: bool


class Port:
    """Judges handle messages of one device at a time and packs the answers.

    home: the tool's pose at the start; method: the exchange method, which the device must share.
    """

    def __init__(self, home: Planar, method: str = "pspm"):
        self.home, self._method = home, float(EXCHANGE_METHODS.index(method))
        self.session = float(secrets.randbits(48) | 1)
        self.refused = dict.fromkeys(exchange_samples.REFUSALS[1:], 0)
        self._layouts = {axes: JointLayout(exchange_names(axes)) for axes in (1, 2, 3)}
        self._axes = {layout.size: axes for axes, layout in self._layouts.items()}
        self._sequence, self.scene = 0, 0
        self._answers = deque(maxlen=ANSWERS_KEPT)  # (own sequence, time of the handle sample answered [ns])
        self._near_layout, self._near = CloudLayout(LOCAL_CONTACT), np.zeros(MOST, LOCAL_CONTACT)
        self._peer_session = self._peer_sequence = 0.0
        self._accepted_ns = 0
        exchange_samples.gains_hash(0.0, 0.0, 0.0, 0.0)  # compiled here, not with the first sample

    def take(self, data: bytes, now_ns: int) -> Question | None:
        """The question in a message that arrived at `now_ns` (own monotonic clock), or None: refused and counted."""
        axes = self._axes.get(len(data), 1)
        if not self._layouts[axes].matches(data):
            return self._refuse(exchange_samples.OTHER_NAMES)
        stamp_ns, position, velocity, effort = self._layouts[axes].numbers(data)
        tail, arrays = position[axes:], (position[:axes], velocity[:axes], effort[:axes])
        code = self._judge(arrays, tail, now_ns)
        if code != exchange_samples.ACCEPTED:
            return self._refuse(code)
        return self._accept(stamp_ns, arrays, tail, now_ns)

    def answer(self, question: Question, tool: ToolSample) -> bytes:
        """Bytes of the tool message: stamped with, and naming, the handle sample it answers."""
        self._sequence += 1
        axes, tail = question.axes, question.tail
        self._answers.append((self._sequence, question.handle.time_ns))
        own = list(tail)
        own[exchange_samples.SESSION], own[exchange_samples.SEQUENCE] = self.session, float(self._sequence)
        own[exchange_samples.ANSWERED_SESSION], own[exchange_samples.ANSWERED] = (
            tail[exchange_samples.SESSION],
            tail[exchange_samples.SEQUENCE],
        )
        own[exchange_samples.CONTACT], own[exchange_samples.ENERGY] = float(tool.contact), tool.energy
        still = [0.0] * len(own)
        arrays = [*tool.position[:axes], *own], [*tool.velocity[:axes], *still], [*tool.force_on_tool[:axes], *still]
        return self._layouts[axes].pack(question.handle.time_ns, *arrays)

    def lag(self, question: Question) -> float:
        """How old the tool sample was that the device used when it asked [s]: half way there already, half to come."""
        used = question.tail[exchange_samples.ANSWERED]
        return next(
            (
                1e-9 * (question.handle.time_ns - time_ns)
                for sequence, time_ns in reversed(self._answers)
                if sequence == used
            ),
            0.0,
        )

    def local_contacts(self, question: Question, common: dict[str, float], table: np.ndarray) -> bytes:
        """Bytes of the local contacts that go with the answer just given."""
        near, tail = self._near, question.tail
        near["session"], near["sequence"], near["scene"] = self.session, self._sequence, self.scene
        near["answered_session"], near["answered"] = tail[exchange_samples.SESSION], tail[exchange_samples.SEQUENCE]
        for name, value in common.items():
            near[name] = value
        near.view(np.float64).reshape(MOST, -1)[:, len(COMMON) :] = table
        return self._near_layout.pack(question.handle.time_ns, near)

    def _judge(self, arrays, tail, now_ns):
        if not (all(_within(numbers, exchange_samples.LIMIT) for numbers in arrays) and _within(tail, LARGEST_WHOLE)):
            return exchange_samples.NOT_FINITE
        if tail[exchange_samples.LAYOUT] != exchange_samples.LAYOUT_VERSION:
            return exchange_samples.OTHER_LAYOUT
        if not all(0.0 <= gain <= exchange_samples.LIMIT for gain in tail[GAINS]):
            return exchange_samples.NOT_FINITE
        if tail[exchange_samples.METHOD] != self._method:
            return exchange_samples.OTHER_METHOD
        if tail[exchange_samples.GAINS] != exchange_samples.gains_hash(*tail[GAINS]):
            return exchange_samples.OTHER_GAINS
        if tail[exchange_samples.SESSION] != self._peer_session:
            silent = now_ns - self._accepted_ns >= SILENCE_NS
            return exchange_samples.ACCEPTED if silent or self._peer_session == 0.0 else exchange_samples.SECOND_SENDER
        return (
            exchange_samples.ACCEPTED if tail[exchange_samples.SEQUENCE] > self._peer_sequence else exchange_samples.OLD
        )

    def _accept(self, stamp_ns, arrays, tail, now_ns):
        axes, new = len(arrays[0]), tail[exchange_samples.SESSION] != self._peer_session
        self._peer_session, self._peer_sequence = tail[exchange_samples.SESSION], tail[exchange_samples.SEQUENCE]
        self._accepted_ns = now_ns
        rest = self.home[axes:], (0.0,) * (3 - axes), (0.0,) * (3 - axes)
        position, velocity, effort = ((*known, *missing) for known, missing in zip(arrays, rest, strict=True))
        handle = HandleSample(stamp_ns, position, velocity, *tail[GAINS], effort, tail[exchange_samples.ENERGY])
        return Question(handle, axes, tail, new)

    def _refuse(self, code):
        self.refused[exchange_samples.REFUSALS[code]] += 1


def _within(numbers, limit):
    """Whether all are finite and at most the limit; a sum with NaN in it is NaN, whatever max makes of it."""
    return sum(numbers) - sum(numbers) == 0.0 and max(numbers) <= limit and min(numbers) >= -limit
