# SPDX-License-Identifier: Apache-2.0
"""The motor values on their way to the handle, and what acted over a hold: a force acts later than its tick.

Later by the delays of the device and by the write's own, which the tick after knows.
"""

import math

from haptic_device.control import passivity
from haptic_device.control.records import AXES, HELD
from haptic_device.jit import kernel, njit


@kernel
def was_written(settings, hold, sensors):
    """From when the last motor value acts [ns, as samples are stamped]."""
    hold.acts[int(hold.newest)] += (sensors.write_delay + settings.hardware.delay) * 1e9


@kernel
def acted(hold, sent, i, now, elapsed):
    """Of a force on axis i over the hold that ends now [ns]: its mean, and Σ (f − mean)² τ of its changes.

    sent: account.sent.

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
def send(hold, account):
    """The forces of this tick [N | N m, in the world]; from when they act the next tick knows."""
    at = (int(hold.newest) + 1) % HELD
    hold.newest, hold.acts[at], account.shares[at] = at, hold.deadline, account.share
    for i in range(AXES):
        account.sent[at, i] = account.force[i]


@kernel
def set_lateness(port, least, most, period, ratio):
    """Fills in how late forces act: `least` to `most` [s] after their sample, in periods.

    layers: (from, to in a hold, fewest, most ticks old). needs, ratio: as of passivity.weights.
    """
    port.least, port.most, port.ratio = least, most, ratio
    low, high = least / period, most / period
    if high - math.floor(high) < 1e-9:
        high = math.floor(high)
    a, b = low - math.floor(low), high - math.floor(high)
    cuts = (0.0, min(a, b), max(a, b), 1.0)
    for layer in range(3):
        start, end = cuts[layer], cuts[layer + 1]
        port.layers[layer, 0], port.layers[layer, 1] = start, end
        port.layers[layer, 2] = math.floor(low) + (1.0 if start < a else 0.0)
        port.layers[layer, 3] = math.floor(high) + (1.0 if start < b else 0.0)
    port.whole, port.holds = math.floor(high), math.ceil(high) + 1.0
    port.needs[0], port.needs[1], port.needs[2], port.needs[3] = passivity.weights(low, high, ratio)
