# SPDX-License-Identifier: Apache-2.0
"""The exchange in one compiled call: the bytes that Python answers with, and Python for all that is not ordinary."""

import math
import struct

import numpy as np
import pytest

from haptic_device.law import exchange
from haptic_device.node.wire import JointLayout, exchange_names
from haptic_sim.at_once import AtOnce, is_for
from haptic_sim.node.port import Port
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation
from haptic_sim.tool_port import port_of

GAINS = (2000.0, 2.0, 2.0, 0.002)
PERIOD = 1_000_000  # [ns]


class End:
    """A simulation and its port of messages, which answer at length, and at once where that is asked for."""

    def __init__(self, scene, axes, at_once):
        loaded = load(scene)
        self.simulation, self.port = Simulation(loaded, port=port_of("pspm")), Port(loaded.tool.pose)
        self.port.session, self.axes, self.at_once, self.ordinary = 4711.0, axes, at_once, 0
        self.lent = None

    def answer(self, data, now_ns):
        if self.lent is not None and (answer := self.lent.answer(data, now_ns)) is not None:
            self.ordinary += 1
            return answer
        self.give_back()
        if (question := self.port.take(data, now_ns)) is None:
            return None
        answer = self.port.answer(question, self.simulation.exchange(question.handle))
        if self.at_once:
            self.lent = AtOnce(self.simulation, self.port.layout(self.axes), self.axes)
            self.lent.borrow(self.port, question.tail)
        return answer

    def give_back(self):
        if self.lent is not None:
            self.lent.give_back(self.port)
            self.lent = None


def question(k, axes, position, velocity=(0.0, 0.0, 0.0), stamp_ns=None, layout=None, **tail):
    """Bytes of the k-th handle sample, with what is given changed in its tail."""
    said = dict.fromkeys(exchange.TAIL, 0.0) | {"layout_version": exchange.LAYOUT_VERSION, "session": 77.0}
    said |= dict(zip(exchange.TAIL[exchange.GAIN_0 :], GAINS, strict=False)) | {"sequence": float(k)}
    said |= {"exchange_method": float(exchange.PSPM), "gains_hash": exchange.gains_hash(*GAINS)} | tail
    numbers, still = list(said.values()), [0.0] * len(exchange.TAIL)
    stamp = 1_700_000_000 * 10**9 + k * PERIOD if stamp_ns is None else stamp_ns
    layout = layout or JointLayout(exchange_names(axes))
    return layout.pack(stamp, [*position[:axes], *numbers], [*velocity[:axes], *still], [0.0] * layout.count)


def path(k):
    """Where the handle of the k-th sample is: to and fro through the wall, and round."""
    return 0.03 * math.cos(0.01 * k), 0.02 * math.sin(0.013 * k), 0.1 * math.sin(0.02 * k)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("scene", ["free_space", "wall"])
def test_the_answers_at_once_are_those_at_length_to_the_bit(scene, axes):
    ends, random = [End(scene, axes, at_once) for at_once in (False, True)], np.random.default_rng(axes)
    assert is_for(ends[1].simulation)
    shipped, stamp = 0.0, 10**9
    for k in range(1, 1500):
        stamp += int(random.integers(0, 3 * PERIOD)) if k % 400 else 30 * PERIOD  # now and then a new time base
        shipped += 1e-5 * random.random()
        rate = tuple(random.normal(size=3) * 0.1)
        data = question(k, axes, path(k), rate, stamp, energy=shipped, answered=float(k - 1))
        assert ends[0].answer(data, stamp) == ends[1].answer(data, stamp)
        if k % 300 == 0:
            ends[1].give_back()
    ends[1].give_back()
    assert ends[1].ordinary > 1400
    one, other = (end.simulation for end in ends)
    assert one.counters == other.counters and one.ledger.balance == other.ledger.balance
    assert one.method.position == other.method.position and one.method.touching == other.method.touching
    assert one.port.tank == other.port.tank and one.port.returned == other.port.returned


STRANGE = {
    "old": {"sequence": 5.0}, "late": {"stamp_ns": 10**9}, "not finite": {"answered": math.nan},
    "other session": {"session": 78.0}, "other method": {"exchange_method": 0.0}, "other gains": {"stiffness": 1.0},
    "other layout": {"layout_version": 2.0}, "beyond": {"energy": 1e300}, "NaN": {"position": (math.nan, 0.0, 0.0)},
    "far": {"velocity": (0.0, -1e7, 0.0)}, "other names": {"layout": JointLayout(("a", "b", "c", *exchange.TAIL))},
}  # fmt: skip


@pytest.mark.parametrize("change", STRANGE.values(), ids=STRANGE)
def test_what_is_not_ordinary_is_left_to_python_and_changes_nothing(change):
    end = End("wall", 3, True)
    for k in range(1, 10):
        end.answer(question(k, 3, path(k)), k * PERIOD)
    state, drawn = end.lent.state.copy(), end.simulation.port.memory.copy()
    strange = question(**{"k": 10, "axes": 3, "position": path(10)} | change)
    for data in (strange, strange[:-1], b"", bytes(len(strange)), struct.pack("<i", 7) * (len(strange) // 4)):
        assert end.lent.answer(data, 10 * PERIOD) is None
    assert end.lent.state.tobytes() == state.tobytes() and np.array_equal(end.simulation.port.memory, drawn)
    assert end.lent.answer(question(10, 3, path(10)), 10 * PERIOD) is not None
