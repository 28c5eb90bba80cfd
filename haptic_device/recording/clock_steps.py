# SPDX-License-Identifier: Apache-2.0
"""Steps of the system clock in a bag, between times received and our nodes' stamps or numbers; times without them."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

OURS = ("/handle", "/tool", "/encoder", "/operator/state")  # ends of topics sent at once, with stamps of no step
LEAST = 100_000_000  # [ns] of a step; NTP slews less than 128 ms, and messages are late by less
_LASTS = 1_000_000_000  # [ns] for which a clock that was set forward stays so; a message that was late does not
_NEAR = 100  # messages beside a step that tell whether another time took it too
Nanoseconds = npt.NDArray[np.int64]


class ClockStep(NamedTuple):
    """The last time before the clock was set and the first after it; by how much, < 0: back. All in ns."""

    before: int
    after: int
    size: int


def steps_of(received: Nanoseconds, stamps: Nanoseconds, ours: bool) -> list[ClockStep]:
    """The steps between the messages of one topic, which are in the order of their numbers."""
    ways, lag = np.diff(received), received - stamps
    sizes = np.where(ways < -LEAST, ways - int(np.median(ways)), 0) if len(ways) else ways
    for place in np.flatnonzero(np.abs(np.diff(lag)) > LEAST) if ours else ():
        until = int(np.searchsorted(stamps, stamps[place + 1] + _LASTS))
        size = lag[place + 1 : max(until, place + 2)].min() - lag[place]
        if sizes[place] or (size > LEAST and until < len(stamps)):
            sizes[place] = size
    return [ClockStep(int(received[i]), int(received[i + 1]), int(sizes[i])) for i in np.flatnonzero(sizes)]


def shifts_of(received: Nanoseconds, steps: Iterable[ClockStep]) -> list[tuple[int, int]]:
    """(index of the first message after it, size [ns]) of each step; received: in the order in which they came."""
    found, begin = [], 0
    for step in steps:  # where the way to the next is most like it; a topic that begins later has it behind it
        times = received[begin:]
        ways = np.diff(times) * np.sign(step.size)
        around = (times[:-1] < step.before + LEAST) & (times[1:] > step.after - LEAST)
        places = np.flatnonzero(around & ((ways > 0) | (times[:1] < step.after)))
        none = 0 if np.all(times[:1] >= step.after) else len(times)
        begin += int(places[np.argmax(ways[places])]) + 1 if len(places) else none
        found.append((begin, step.size))
    return found


def without_steps(times: Nanoseconds, received: Nanoseconds, shifts: list[tuple[int, int]]) -> Nanoseconds:
    """Times of messages as the clock of before the first step counts, where they took the steps of those received."""
    lag, found = received - times, times.copy()
    for place, size in shifts:
        usual = np.median(lag[max(0, place - _NEAR) : place]) if place else 0.0
        took = np.abs(lag[place:] - usual) < abs(size) / 2
        if 2 * np.sum(took[:_NEAR]) > len(took[:_NEAR]):
            took[_NEAR:] = True
            found[place:] -= size * (took & (times[place:] != 0))
    return found
