# SPDX-License-Identifier: Apache-2.0
"""Steps of the system clock in a bag, found in the order in which messages were written; times without them.

Times received rise in that order unless the clock is set back. A gap in them is a clock set forward if the stamps of
our nodes, which slew, are behind by so much from then on; a recorder that stood still soon has new messages again.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

OURS = ("/handle", "/tool", "/encoder", "/operator/state")  # ends of topics sent at once, with stamps of no step
LEAST = 100_000_000  # [ns] of a step; NTP slews less than 128 ms
_BESIDE = 1_000_000_000  # [ns] on either side of a step in which the least lag of the stamps counts
_NEAR = 100  # messages beside a step that tell whether another time took it too
Nanoseconds = npt.NDArray[np.int64]


class Written(NamedTuple):
    """Of each message of a topic, as they were written: place among all of the bag; times [ns], 0: no stamp; number."""

    place: Nanoseconds
    stamp: Nanoseconds
    received: Nanoseconds
    published: Nanoseconds
    sequence: Nanoseconds


class ClockStep(NamedTuple):
    """Place of the first message after it; when, since the first message without the steps before, and size [ns]."""

    place: int
    since: int
    size: int


def steps_of(topics: Mapping[str, Written]) -> list[ClockStep]:
    """The steps of the clock in a bag; size < 0: it was set back."""
    places = np.concatenate([np.empty(0, np.int64), *(one.place for one in topics.values())])
    received = np.concatenate([np.empty(0, np.int64), *(one.received for one in topics.values())])[np.argsort(places)]
    places.sort()
    ways, found, moved = np.diff(received), [], 0
    for last in np.flatnonzero(np.abs(ways) > LEAST // 2).tolist():
        place, before, after = int(places[last + 1]), int(received[last]), int(received[last + 1])
        ours = [one for name, one in topics.items() if name.endswith(OURS)]
        sizes = [way for one in ours if (way := _told(one, place, before, after)) is not None]
        if ways[last] < 0:
            fallen = _fallen(topics.values(), place)
            sizes = fallen and ([way for way in sizes if way < -LEAST] or fallen)  # stamps may follow the clock
        if sizes and abs(size := round(np.median(sizes))) > LEAST:
            found.append(ClockStep(place, before - int(received[0]) - moved, size))
            moved += size
    return found


def _told(topic: Written, place: int, before: int, after: int) -> int | None:
    """By how much a topic's stamps are more behind from here on than before [ns]; None where too few messages tell."""
    then, stamped, lag = topic.place >= place, topic.stamp > 0, topic.received - topic.stamp
    one = ~then & stamped & (topic.received > before - _BESIDE)
    other = then & stamped & (topic.received < after + _BESIDE)
    if not one.any() or not other.any() or np.ptp(topic.received[other]) < _BESIDE // 2:
        return None
    return int(lag[other].min() - lag[one].min())


def _fallen(topics: Iterable[Written], place: int) -> list[int]:
    """By how much the times received of topics fall here [ns], their usual way added; none where numbers fall as well.

    That is another recording, joined to the first. Where no topic falls, they were written one after another.
    """
    found = []
    for topic in topics:
        cut, ways = int(np.searchsorted(topic.place, place)), np.diff(topic.received)
        if (
            0 < cut < len(topic.place)
            and ways[cut - 1] < -LEAST // 2
            and topic.sequence[cut] >= topic.sequence[cut - 1]
        ):
            found.append(int(ways[cut - 1] - np.median(ways)))
    return found


def without_steps(times: Nanoseconds, received: Nanoseconds, shifts: Sequence[tuple[int, int]]) -> Nanoseconds:
    """Times of messages as the clock of before the first step counts, where they took the steps of those received.

    shifts: (index of the first message after it, size [ns]) of each step.
    """
    lag, found = received - times, times.copy()
    for place, size in shifts:
        usual = np.median(lag[max(0, place - _NEAR) : place]) if place else 0.0
        took = np.abs(lag[place:] - usual) < abs(size) / 2
        if 2 * np.sum(took[:_NEAR]) > len(took[:_NEAR]):
            took[_NEAR:] = True
            found[place:] -= size * (took & (times[place:] != 0))
    return found
