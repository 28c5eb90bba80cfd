# SPDX-License-Identifier: Apache-2.0
"""When to look for the answer to a handle sample: not before it can be there, often while it is due, seldom after.

Each look costs a wake-up, and an answer that waits for one is that much older. So the times from sending on at which it
is due are followed as answers come: `first`, at which one of SHARE is there already, and `last`, after which one of
SHARE comes. Each answer moves them by STEP, or by SHARE − 1 steps the other way, so that they rest where that is as
often as wanted (a stochastic approximation of two quantiles; Robbins and Monro 1951). How long an answer waited for the
first look nobody knows; that it did is enough to follow answers that come earlier than ever.
"""

from haptic_device.jit import njit

LOOK, POLL, IDLE = 10_000, 100_000, 1_000_000  # [ns] between looks: while it is due, at most, and while none is
WINDOW = 200_000  # [ns] for which it may be due: looking longer so often is not worth a core
STEP, SHARE = 200, 16  # [ns] an answer


@njit
def next_look(now, sent, first, last, in_time):
    """Time of the next look for the answer to a sample of `sent`, all times in ns; first and last count from there.

    in_time: whether the sample before was answered before this one was sent; else answers come at any time, or never.
    """
    if not in_time:
        return now + POLL
    if now < sent + first:
        return sent + first
    overdue = max(0, now - sent - min(last, first + WINDOW))
    return now + min(POLL, LOOK + overdue // 4)


@njit
def first_after(first, waited):
    """`first` [ns] after an answer that was there at the first look (waited), or was not."""
    return max(0, first - (SHARE - 1) * STEP) if waited else first + STEP


@njit
def last_after(last, trip):
    """`last` [ns] after an answer that came so long after its sample [ns]."""
    return last + (SHARE - 1) * STEP if trip > last else max(0, last - STEP)
