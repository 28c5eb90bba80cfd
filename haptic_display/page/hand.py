# SPDX-License-Identifier: Apache-2.0
"""Where a page wants the operator's hand: clamped to the workspace, and led there no faster than a hand moves."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from haptic_device.message_fields import AXES

if TYPE_CHECKING:  # it brings the web server
    from haptic_display.page.session import Session

Planar = tuple[float, float, float]
AFTER = 0.3  # s, for which a target that has been reached is said again: a sample may be lost
THERE = 1e-4  # [m, rad] from a place at which the hand's target is there
SILENCE = 2.0  # s without a word of the page that leads it, after which the hand lets go
LONGEST = 0.5  # s of silence that one look counts: what the viewer itself has slept through is none of the page's


class Limits(NamedTuple):
    """Workspace of each axis that the device has, in the world [m, m, rad]; fastest way [m/s] and turn [rad/s]."""

    workspace: tuple[tuple[float, float], ...]
    speed: float
    turn: float


class Hand:
    """`goal` is what the page asked for, `sent` what the hand was told last; None while nobody holds the hand.

    leader: the page that leads it and has not let go. loose: the hand has let go, and gives in to the handle until it
    rests where that is."""

    def __init__(self) -> None:
        self.goal: Planar | None = None
        self.sent: Planar | None = None
        self.loose = False
        self.leader: Session | None = None
        self._moved = self._reached = -math.inf
        self._heard, self._silent, self._listened = 0, 0.0, -math.inf

    def take(self, place: Sequence[float], now: float) -> None:
        """Begins from where the hand's target is now [m, m, rad]; now [s]."""
        self.goal = self.sent = (place[0], place[1], place[2])
        self.loose, self._silent = False, 0.0
        self._moved, self._reached = now, -math.inf

    def release(self) -> None:
        """Forgets everything: the device has gone."""
        self.goal = self.sent = self.leader = None
        self.loose = False

    def let_go(self, now: float) -> None:
        """Pulls at nothing from now on [s], wherever the handle goes."""
        self.goal = self.sent = self.leader = None
        self.loose, self._reached = True, now

    def listen(self, now: float, heard: int) -> None:
        """Lets go after SILENCE. heard: messages so far of the page that leads it; now [s]."""
        elapsed, self._listened = min(LONGEST, now - self._listened), now
        self._silent = self._silent + elapsed if heard == self._heard else 0.0
        self._heard = heard
        if self.goal is not None and self._silent > SILENCE:
            self.let_go(now)

    def give_in(self, now: float, handle: Sequence[float], target: Sequence[float], limits: Limits) -> Planar | None:
        """Loose, its next target, which is where the handle is, within the limits: so it pulls at nothing. None once
        its target has been there for AFTER, and when it is held. now [s]."""
        ends = (*limits.workspace, *[(-math.inf, math.inf)] * 3)
        x, y, theta = (min(high, max(low, at)) for at, (low, high) in zip(handle, ends, strict=False))
        place = x, y, theta
        if any(abs(a - b) > THERE for a, b in zip(place, target, strict=True)):
            self._reached = now
        self.loose = self.loose and now < self._reached + AFTER
        return place if self.loose else None

    def aim(self, place: dict[str, float], limits: Limits) -> str:
        """Sets the goal's coordinates that the place names; returns a hint where it had to be clamped, else ""."""
        assert self.goal is not None  # taken before
        goal, hints = list(self.goal), []
        for i, axis in enumerate(AXES):
            if axis not in place:
                continue
            if i >= len(limits.workspace):
                hints.append(f"the device has no {axis} axis")
                continue
            low, high = limits.workspace[i]
            goal[i] = min(high, max(low, place[axis]))
            if goal[i] != place[axis]:
                hints.append(f"{axis} ends at {_shown(goal[i], axis)}: edge of the workspace")
        self.goal = (goal[0], goal[1], goal[2])
        return "; ".join(hints)

    def lead(self, now: float, limits: Limits) -> Planar | None:
        """The next target on the way to the goal; None when there is nothing to be said. now [s]."""
        if self.goal is None or self.sent is None:
            return None
        elapsed, self._moved = min(0.1, now - self._moved), now
        if self.sent == self.goal:
            return self.sent if now < self._reached + AFTER else None
        self.sent = _towards(self.sent, self.goal, elapsed, limits)
        if self.sent == self.goal:
            self._reached = now
        return self.sent


def _towards(sent: Planar, goal: Planar, elapsed: float, limits: Limits) -> Planar:
    (x, y, theta), (gx, gy, turn) = sent, goal
    way, step = math.hypot(gx - x, gy - y), limits.speed * elapsed
    share = 1.0 if way <= step else step / way
    most = limits.turn * elapsed
    theta += min(most, max(-most, turn - theta))
    return (gx, gy, theta) if share == 1.0 else (x + share * (gx - x), y + share * (gy - y), theta)


def _shown(value: float, axis: str) -> str:
    return f"{value:.2f} rad" if axis == "theta" else f"{1e3 * value:.1f} mm"
