# SPDX-License-Identifier: Apache-2.0
"""The system clock as CLOCK_MONOTONIC and an offset, so that stamps differ as the times that they are of.

Where the system clock is set while a node runs, its stamps follow by 0.1 ms a second. The simulation's time is that of
the stamps: as long as they follow, one exchange in half a second is 50 us longer or shorter.
"""

import time

LOOKS = 5  # readings, of which the one with the least between its ends counts
TOLERATED = 1_000_000  # [ns] that the system clock may be away before it is followed
SLEW, STEP = 1000, 50_000  # of a time at most a 1/SLEW is caught up; [ns] at once, half of the shortest tick


class SessionClock:
    """Stamps of one node. `offset` [ns]: system clock less CLOCK_MONOTONIC, as the stamps have it.

    The offset is read once. Where the system clock is set later, `follow` brings the offset after it so slowly that
    stamps of different ticks never go back and never meet. One thread calls it; any may ask for stamps.
    """

    def __init__(self) -> None:
        self.offset = difference()
        self._followed = time.monotonic_ns()

    def stamp(self, monotonic_ns: float) -> int:
        """ROS time [ns] of a time on CLOCK_MONOTONIC [ns]."""
        return int(monotonic_ns) + self.offset

    def follow(self) -> int:
        """The offset, nearer to the system clock where that was set; to be called twice a second."""
        now = time.monotonic_ns()
        most, self._followed = min(STEP, (now - self._followed) // SLEW), now
        gap = difference() - self.offset
        if abs(gap) > TOLERATED:
            self.offset += max(-most, min(most, gap))
        return self.offset


def difference() -> int:
    """System clock less CLOCK_MONOTONIC [ns]; a thread that is held up between the two readings does not falsify it."""
    looks = [(time.monotonic_ns(), time.time_ns(), time.monotonic_ns()) for _ in range(LOOKS)]
    before, system, after = min(looks, key=lambda look: look[2] - look[0])
    return system - (before + after) // 2
