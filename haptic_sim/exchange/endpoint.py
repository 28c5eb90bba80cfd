# SPDX-License-Identifier: Apache-2.0
"""The simulation's end of the exchange: bytes of `handle` in, bytes of `tool` and `local_contacts` out.

Of the messages that have come the newest that is accepted is answered; the others are counted, refused or not. A device
with fewer axes than the plane leaves the others where the scene put the tool.

After a change of the world and while it is paused the endpoint says nothing: the driver's coupling fades out by age,
and in again once it is answered; meanwhile the world stands still, and its own coupling returns from zero gains.
"""

import math
import secrets
import time
from collections import deque
from collections.abc import Iterable
from functools import cache
from statistics import median
from typing import NamedTuple, Protocol, cast

import numpy as np

from haptic_device.control import exchange_samples
from haptic_device.message_fields import COMMON, LOCAL_CONTACT, MOST, exchange_names
from haptic_device.recording.layouts import CloudLayout, JointLayout
from haptic_sim.exchange.left_out_time import SHARE
from haptic_sim.exchange.simulation import Counters, HandleSample, Planar, Simulation, ToolSample

DEVICE_SILENCE_NS = 500_000_000
"""A second device is listened to only after the first has been silent this long."""
SILENCE_NS = 250_000_000
"""Hides a change of the world: by default the driver's coupling has let go after 0.2 s."""
RETURN_NS = 140_000_000
"""Time over which the coupling's gains then return, as the driver's own fade does."""
LAYOUTS = {axes: JointLayout(exchange_names(axes)) for axes in (1, 2, 3)}
AXES_OF = {layout.size: axes for axes, layout in LAYOUTS.items()}
KEPT = 512  # answers whose time is known when the device names them
TIMES_KEPT = 4096
MEDIAN = 5  # exchanges whose median counts: two of them may have been interrupted
GAINS = slice(exchange_samples.GAIN_0, exchange_samples.GAIN_0 + 4)


class Answerer(Protocol):
    """What answers handle samples: a Simulation, or what stands in for one."""

    sub_step_ns: int
    counters: Counters

    def exchange(self, handle: HandleSample, most: int | None = None) -> ToolSample:
        """The tool sample that answers this handle sample, after at most so many sub-steps."""

    def rejoin(self) -> None:
        """The next handle sample starts a new time base."""


class Question(NamedTuple):
    """An accepted handle sample, its number of axes and its tail, and whether its session is new."""

    handle: HandleSample
    axes: int
    tail: tuple[float, ...]
    new_session: bool


class Pace:
    """Sub-steps that a world with this `sub_step_ns` may make in one answer.

    A world that makes up all that has passed, and takes longer for it than that, has the more to make up next time. So
    it makes up what fits into the period of the handle samples, and the rest is left out.

    period_ns: of the handle samples, 0 as long as there is none; load: time that the world takes for a second of its
    own [s], NaN as long as it is not known.
    """

    def __init__(self, sub_step_ns: int):
        self._sub_step_ns = sub_step_ns
        self._periods: deque[float] = deque(maxlen=MEDIAN)
        self._costs: deque[float] = deque(maxlen=MEDIAN)
        self._heard: tuple[float, int] | None = None
        self.period_ns, self.load = 0.0, math.nan

    def heard(self, sequence: float, time_ns: int, new_session: bool) -> None:
        """A handle sample is accepted; a session has a period of its own."""
        if new_session:
            self._heard = None
            self._periods.clear()
        before, self._heard = self._heard, (sequence, time_ns)
        if before is not None and time_ns > before[1] and sequence > before[0]:
            self._periods.append((time_ns - before[1]) / (sequence - before[0]))
            self.period_ns = median(self._periods)

    def took(self, sub_steps: int, time_ns: int) -> None:
        """An answer's sub-steps have taken this time; of none nothing is learned."""
        if sub_steps > 0:
            self._costs.append(max(1, time_ns) / sub_steps)
            self.load = median(self._costs) / self._sub_step_ns

    def most(self) -> int:
        """What fits into a period, at least half of the period's own: also a cost that does not depend on the number
        must leave the world some motion. As long as the cost is not known, or just fits, those of one period."""
        wanted = self.period_ns / self._sub_step_ns
        load = self.load if len(self._costs) == MEDIAN else 1.0
        return max(1, math.ceil(wanted if load <= 1.0 else 0.5 * wanted), int(SHARE * wanted / load))

    @property
    def dear(self) -> bool:
        """Whether the world takes longer than it has."""
        return self.load > SHARE


class ExchangeEndpoint:
    """Judges handle samples of one device at a time and has them answered. Times `now_ns` are of one monotonic clock.

    home: the tool's pose at the start; method: the exchange method, which the device must share. answered: samples so
    far; refused: {reason: samples}; compute_ns: what the last answers took; position: of the handle answered last;
    pace: what this world may make up in one answer.
    """

    def __init__(self, simulation: Answerer, home: Planar, method: str = "pspm"):
        self.simulation = cast(Simulation, simulation)  # what is reset or asked for local contacts is one
        self.home, self._method = home, float(exchange_samples.METHODS[method])
        self.session = float(secrets.randbits(48) | 1)
        self.scene, self.paused, self.answered = 0, False, 0
        self.refused = dict.fromkeys(exchange_samples.REFUSALS[1:], 0)
        self.compute_ns: deque[int] = deque(maxlen=TIMES_KEPT)
        self.position: Planar | None = None
        self.pace = Pace(simulation.sub_step_ns)
        self._question: Question | None = None  # answered last
        self._times: deque[tuple[int, int]] = deque(maxlen=KEPT)  # (own sequence, time of the sample answered [ns])
        self._near = np.zeros(MOST, LOCAL_CONTACT)
        self._peer = exchange_samples.Peer(0.0, 0.0, 0)
        self._silent_until_ns = self._returned_ns = 0
        self._judge(np.zeros((3, LAYOUTS[1].count)), 1, 0)  # compiled here, not with the first sample

    def answer(self, messages: Iterable[bytes], now_ns: int) -> bytes | None:
        """Bytes of the tool message that answers the newest of these `handle` messages, oldest first, that is accepted.

        None if none is, or in a silence. ValueError if the world cannot take it.
        """
        began = time.perf_counter_ns()
        questions = [one for data in messages if (one := self._question_in(data, now_ns)) is not None]
        if not questions:
            return None
        if new_session := any(one.new_session for one in questions):
            self.simulation.rejoin()
        question = questions[-1]
        self.pace.heard(question.tail[exchange_samples.SEQUENCE], question.handle.time_ns, new_session)
        tool = self._in_time(question.handle, now_ns)
        if tool is None:
            return None
        self._question, self.position = question, question.handle.position
        answer = self._pack(question, tool)
        self.compute_ns.append(time.perf_counter_ns() - began)
        return answer

    def exchange(self, handle: HandleSample, now_ns: int, most: int | None = None) -> ToolSample | None:
        """The world's answer to an accepted handle sample, after at most so many sub-steps; None in a silence, after
        which a new time base begins."""
        if self.paused or now_ns < self._silent_until_ns:
            self._returned_ns = now_ns + RETURN_NS
            self.simulation.rejoin()
            return None
        tool = self.simulation.exchange(self._faded(handle, now_ns), most)
        self.answered += 1
        return tool

    def local_contacts(self) -> bytes:
        """Bytes of the local contacts that go with the answer just given."""
        question, found, near = self._question, self.simulation.local_contacts, self._near
        assert question is not None  # an answer was given
        found.look(self._lag(question))
        near["session"], near["sequence"], near["scene"] = self.session, self.answered, self.scene
        near["answered_session"] = question.tail[exchange_samples.SESSION]
        near["answered"] = question.tail[exchange_samples.SEQUENCE]
        for name, value in found.common.items():
            near[name] = value
        near.view(np.float64).reshape(MOST, -1)[:, len(COMMON) :] = found.table
        return _contact_layout().pack(question.handle.time_ns, near)

    def reset(self, now_ns: int) -> None:
        """Put the world back to the scene's start."""
        self._fall_silent(now_ns)
        self.simulation.reset()

    def load(self, simulation: Simulation, now_ns: int) -> None:
        """Go on with another world, from its own home; it takes over the tool's port."""
        simulation.attach(self.simulation.port)  # not before: the world that runs pulls by it
        self.simulation, self.home = simulation, simulation.scene.tool.pose
        self.pace = Pace(simulation.sub_step_ns)
        self.scene += 1
        self._fall_silent(now_ns)

    def pause(self, paused: bool, now_ns: int) -> None:
        """Let the world stand still, or go on."""
        if self.paused and not paused:
            self._fall_silent(now_ns)
        self.paused = paused

    def _in_time(self, handle: HandleSample, now_ns: int) -> ToolSample | None:
        """The world's answer, after no more sub-steps than it has time for."""
        before, began = self.simulation.counters.sub_steps, time.perf_counter_ns()
        tool = self.exchange(handle, now_ns, self.pace.most())
        self.pace.took(self.simulation.counters.sub_steps - before, time.perf_counter_ns() - began)
        return tool

    def _fall_silent(self, now_ns: int) -> None:
        self._silent_until_ns = now_ns + SILENCE_NS

    def _faded(self, handle: HandleSample, now_ns: int) -> HandleSample:
        """The handle sample with gains that return linearly after a silence."""
        missing = (self._returned_ns - now_ns) / RETURN_NS
        if missing <= 0.0:
            return handle
        return handle._replace(**{name: (1.0 - missing) * gain for name, gain in handle.gains._asdict().items()})

    def _lag(self, question: Question) -> float:
        """How old the tool sample was that the device used when it asked [s]: half way there already, half to come."""
        used, asked_ns = question.tail[exchange_samples.ANSWERED], question.handle.time_ns
        return next((1e-9 * (asked_ns - time_ns) for number, time_ns in reversed(self._times) if number == used), 0.0)

    def _question_in(self, data: bytes, now_ns: int) -> Question | None:
        """The question in a message that arrived at `now_ns`, or None: refused and counted."""
        axes, before = AXES_OF.get(len(data), 1), self._peer.session
        if not LAYOUTS[axes].matches(data):
            self._refuse(exchange_samples.OTHER_NAMES)
            return None
        stamp_ns, *arrays = LAYOUTS[axes].numbers(data)
        if code := self._judge(np.array(arrays), axes, now_ns):
            self._refuse(code)
            return None
        tail, missing = arrays[0][axes:], 3 - axes
        self._peer = exchange_samples.Peer(tail[exchange_samples.SESSION], tail[exchange_samples.SEQUENCE], now_ns)
        position = (*arrays[0][:axes], *self.home[axes:])
        velocity, limit = ((*of[:axes], *(0.0,) * missing) for of in (arrays[1], arrays[2][axes:][GAINS]))
        whole = stamp_ns, position, velocity, *tail[GAINS], tail[exchange_samples.ENERGY], limit
        return Question(HandleSample._make(whole), axes, tail, self._peer.session != before)

    def _judge(self, sample: np.ndarray, axes: int, now_ns: int) -> int:
        """ACCEPTED, or why it is refused."""
        return exchange_samples.judge_handle(sample, axes, self._peer, self._method, now_ns, DEVICE_SILENCE_NS)

    def _refuse(self, code: int) -> None:
        self.refused[exchange_samples.REFUSALS[code]] += 1

    def _pack(self, question: Question, tool: ToolSample) -> bytes:
        """Bytes of the tool message: stamped with, and naming, the handle sample it answers."""
        axes, own = question.axes, list(question.tail)
        self._times.append((self.answered, question.handle.time_ns))
        own[exchange_samples.ANSWERED_SESSION] = own[exchange_samples.SESSION]
        own[exchange_samples.ANSWERED] = own[exchange_samples.SEQUENCE]
        own[exchange_samples.SESSION], own[exchange_samples.SEQUENCE] = self.session, float(self.answered)
        own[exchange_samples.CONTACT], own[exchange_samples.ENERGY] = float(tool.contact), tool.energy
        still = [0.0] * len(own)
        arrays = [*tool.position[:axes], *own], [*tool.velocity[:axes], *still], [*tool.force_on_tool[:axes], *still]
        return LAYOUTS[axes].pack(question.handle.time_ns, *arrays)


@cache
def _contact_layout() -> CloudLayout:
    return CloudLayout(LOCAL_CONTACT)
