# SPDX-License-Identifier: Apache-2.0
"""Plays a way in time, whole or by steps: what is slowed is the hand's motion, never the physics."""

import math
from itertools import accumulate, pairwise
from typing import NamedTuple

from haptic_sim.scene.motion import Place

OFF, PLAYING, PAUSED = "off", "playing", "paused"
ARM = 0.05  # [m] way that turning by a radian counts as
SHARP = 0.5  # cosine of the bend from which on the hand stops at a corner: 60 degrees
SLOW = 0.25  # of the speed
STEPS = 10  # of the whole way
REST = 0.5  # s that the hand stays at the end: what it presses against is felt there
LONGEST = 0.1  # s that one look counts at most: what the viewer has slept through is not caught up


class Leg(NamedTuple):
    """A part of the way that is led through in one go: its places, the way to each [m], its start and end in time, as
    shares of the whole."""

    places: tuple[Place, ...]
    ways: tuple[float, ...]
    start: float
    end: float


class Playback:
    """`state` is OFF, PLAYING or PAUSED; `share` of the whole way's time that has been played; `slow`: at a quarter of
    the speed."""

    def __init__(self) -> None:
        self.state, self.share, self.slow = OFF, 0.0, False
        self._legs: list[Leg] = []
        self._seconds, self._until, self._looked, self._rested = 1.0, 1.0, 0.0, 0.0

    def begin(self, way: tuple[Place, ...], seconds: float) -> None:
        """Stands at the start of a way that takes so many seconds. ValueError for one that leads nowhere."""
        self._legs = legs(way)
        self._seconds, self._rested, self.share, self.state = seconds, 0.0, 0.0, PAUSED

    def go_on(self, now: float) -> None:
        """To the end, from where it is; now [s]."""
        self.state, self._until, self._looked = PLAYING, 1.0, now

    def step(self, now: float) -> None:
        """A tenth further, where it stands then; now [s]."""
        self.go_on(now)
        self._until = min(1.0, (math.floor(self.share * STEPS + 1e-9) + 1) / STEPS)

    def pause(self) -> None:
        """Stands still."""
        self.state = PAUSED if self.state == PLAYING else self.state

    def stop(self) -> None:
        """No more of it."""
        self.state, self.share = OFF, 0.0

    def place(self, now: float) -> Place:
        """Where the hand shall be now [m, m, rad], while it plays; it is over REST after the end. now [s]."""
        elapsed, self._looked = min(LONGEST, now - self._looked), now
        self._rested += elapsed if self.share == 1.0 else 0.0
        self.share = min(self._until, self.share + elapsed * (SLOW if self.slow else 1.0) / self._seconds)
        place = along(self._legs, self.share)
        if self._rested >= REST:
            self.stop()
        elif self.share == self._until < 1.0:
            self.state = PAUSED
        return place


def legs(way: tuple[Place, ...]) -> list[Leg]:
    """The parts of a way between its sharp corners, each with its share of the time by its length."""
    pieces = _pieces([place for place, before in zip(way, (None, *way), strict=False) if place != before])
    lengths = [_ways(piece)[-1] for piece in pieces]
    total, found, begin = sum(lengths), [], 0.0
    if total == 0.0:
        raise ValueError("this scene shows no way")
    for piece, length in zip(pieces, lengths, strict=True):
        found.append(Leg(tuple(piece), _ways(piece), begin, begin + length / total))
        begin += length / total
    return found


def along(parts: list[Leg], share: float) -> Place:
    """The place after this share of the time: least jerk within each part, at rest at its ends."""
    leg = next((part for part in parts if share < part.end), parts[-1])
    s = min(1.0, max(0.0, (share - leg.start) / (leg.end - leg.start)))
    come = leg.ways[-1] * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    k = next((k for k in range(1, len(leg.ways) - 1) if come < leg.ways[k]), len(leg.ways) - 1)
    t = min(1.0, (come - leg.ways[k - 1]) / (leg.ways[k] - leg.ways[k - 1]))
    x, y, theta = (a + t * (b - a) for a, b in zip(leg.places[k - 1], leg.places[k], strict=True))
    return x, y, theta


def _pieces(way: list[Place]) -> list[list[Place]]:
    pieces = [way[:2]]
    for place in way[2:]:
        before, corner = pieces[-1][-2:]
        if _bend(_step(before, corner), _step(corner, place)) > SHARP:
            pieces[-1].append(place)
        else:
            pieces.append([corner, place])
    return pieces


def _ways(places: list[Place]) -> tuple[float, ...]:
    return tuple(accumulate((math.hypot(*_step(*leg)) for leg in pairwise(places)), initial=0.0))


def _step(a: Place, b: Place) -> Place:
    return b[0] - a[0], b[1] - a[1], ARM * (b[2] - a[2])


def _bend(a: Place, b: Place) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True)) / (math.hypot(*a) * math.hypot(*b))
