# SPDX-License-Identifier: Apache-2.0
"""The motor values on their way to the handle, and what acted over a hold: a force acts later than its tick.

Later by the delays of the device and by the write's own, which the tick after knows.
"""

import math

from haptic_device.control.records import AXES, HELD
from haptic_device.jit import kernel, njit


@kernel
def was_written(settings, hold, sensors):
    """From when the last motor value acts [ns, as samples are stamped]."""
    hold.acts[int(hold.newest)] += (sensors.write_delay + settings.hardware.delay) * 1e9


@kernel
def acted(hold, sent, i, now, elapsed):
    """Of a force on axis i over the hold that ends now [ns]: its mean, and Σ (f − mean)² τ of its changes.

    sent: hold.written, the motor's force, or hold.coupling_written, what of it is the coupling's.

    Summed as differences from the newest force, so that a force which stays is itself and has not changed.
    """
    end, begin, at = now, now - elapsed * 1e9, int(hold.newest)
    if hold.acts[at] <= begin:  # on time: one force acted
        return sent[at, i], 0.0
    newest, change, square = sent[at, i], 0.0, 0.0
    for _ in range(HELD):
        start = max(begin, hold.acts[at])
        if start < end:
            less, time = sent[at, i] - newest, (end - start) * 1e-9
            change, square, end = change + less * time, square + less * less * time, start
        if end <= begin:
            break
        at = (at - 1) % HELD
    if square == 0.0:
        return newest, 0.0
    # rounding may leave it below 0
    return newest + change / elapsed, max(0.0, square - change * change / elapsed)


@kernel
def unsure(hold, sent, i, motion, now, elapsed, mean):
    """What may be added to both where the times of the samples are not sure: by how much another the mean may be, and
    to Σ (f − mean)² τ.

    A hold that began earlier by u₁ has more of the force f₁ there, one that ended later by u₂ more of f₂: its mean is
    another by (|f₁ − f̄| u₁ + |f₂ − f̄| u₂)/(T − u₁ − u₂) at most, and never beyond the forces that acted.
    """
    after, least = motion.sample_error * 1e-9, elapsed - motion.unsure
    before = motion.unsure - after
    first = _farthest(hold, sent, i, mean, now - elapsed * 1e9, before * 1e9)
    last = _farthest(hold, sent, i, mean, now, after * 1e9)
    off = (first * before + last * after) / least if least > 0.0 else math.inf
    return min(off, max(first, last)), first * first * before + last * last * after


@njit
def _farthest(hold, sent, i, mean, at, error):
    """By how much a force that acts within `error` of this time [ns] is at most another than the mean."""
    most, place, end = 0.0, int(hold.newest), at + error
    for _ in range(HELD):
        if hold.acts[place] < end:
            most, end = max(most, abs(sent[place, i] - mean)), hold.acts[place]
        if end <= at - error:
            break
        place = (place - 1) % HELD
    return most


@kernel
def keep_ways(hold, motion):
    """The way of the hold that ends here, behind those before."""
    at = (int(hold.newest_way) + 1) % HELD
    hold.newest_way = at
    for i in range(AXES):
        hold.ways[at, i] = motion.moved[i]


@kernel
def late_store(settings, observer, hold, i):
    """What springs and dampers that act late may still owe for the ways of the last holds [J], beyond damping_store.

    With W = n + φ periods of delay a spring's force lags by K Σ Δx_{k−j}, j = 1 … n, and by φ of j = n + 1: each
    product K Δx_k Δx_{k−j} is at most half of either square, so Δx² still owes ½ K (W − i) after i more holds; and
    ½ D/T for a damper until its lag, with what the change within a hold may add (passivity.energy_changed).
    """
    late = settings.passivity.lateness / settings.period
    whole = int(late)
    share, owed, spring, damping = late - whole, 0.0, observer.springs[i], settings.hardware.damping[i]
    if late <= 0.0:
        return 0.0
    for at in range(min(HELD, whole + 2)):
        weight = 0.5 * spring * max(0.0, late - at)
        damper = 0.5 * observer.damper[i] / settings.period
        if at <= whole:
            weight += 0.25 * share * (1.0 - share) * spring * spring * settings.period / damping
            weight += damper if at > 0 else 0.0
        else:
            weight += share * damper
        way = hold.ways[(int(hold.newest_way) - at) % HELD, i]
        owed += weight * way * way
    return owed


@kernel
def send(hold, output):
    """The motor value of this tick; from when it acts the next tick knows."""
    at = (int(hold.newest) + 1) % HELD
    hold.newest, hold.acts[at] = at, hold.deadline
    for i in range(AXES):
        hold.written[at, i], hold.coupling_written[at, i] = output.force_on_handle[i], hold.coupling[i]
