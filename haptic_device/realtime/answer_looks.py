# SPDX-License-Identifier: Apache-2.0
"""When to look for the answer to a handle sample: not before it can be there, often while it is due, seldom after.

Each look costs a wake-up, and an answer that waits for one is that much older. So the time `first` from sending on, at
which one answer of SHARE is there already, is followed: each moves it on by STEP, or back by SHARE − 1 steps, so that
it rests where one of SHARE had to wait for that look (a stochastic approximation of a quantile; Robbins and Monro
1951). How long that one waited nobody knows; that it did is enough to follow answers that come earlier than ever. From
`first` on the looks are the rarer the longer it is due, so that an answer waits for a part of its lateness.
"""

from haptic_device.jit import njit

LOOK, POLL, IDLE = 10_000, 100_000, 1_000_000  # [ns] between looks: when it is due, at most, and while none is
PART = 8  # of its lateness, that the next look is away
STEP, SHARE = 200, 16  # [ns] an answer


@njit
def next_look(now, sent, first, in_time):
    """Time of the next look for the answer to a sample of `sent`, all times in ns; first counts from there.

    in_time: whether the sample before was answered before this one was sent; else answers come at any time, or never.
    """
    if not in_time:
        return now + POLL
    late = now - sent - first
    return now + min(POLL, LOOK + late // PART) if late >= 0 else sent + first


@njit
def first_after(first, waited):
    """`first` [ns] after an answer that was there at the first look (waited), or was not."""
    return max(0, first - (SHARE - 1) * STEP) if waited else first + STEP
