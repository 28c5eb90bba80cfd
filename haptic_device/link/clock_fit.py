# SPDX-License-Identifier: Apache-2.0
"""Offset and skew of a device's clock against the host's, from questions and answers.

An answer is four times [ns]: t1 the host asked, t2 the device heard, t3 the device answered, t4 the host heard. The
device's clock less the host's is then at least t3 − t4 and at most t2 − t1; the middle is taken as measured. A straight
line is fitted to these by least squares, in which an answer counts less the older it is (by a factor e each FORGET)
and the longer it was on its way. Answers with more than LATE times the least round trip are left out; that least grows
by a share AGEING with each answer, so that a line that has become slower is taken as it is in the end.

A fit that lies outside these bounds cannot be true, however the delays were shared: after ENOUGH such answers without
one that fits, the clock has been stepped, and the line through these takes the place of the old one.

The error is the largest residual lately, which fades by a hundredth with each answer (of the ones that count, about
1 % are larger), and half of the least round trip: what no answer can tell is how that is shared between the two ways.
While answers contradict the fit, it is not less than the last of their residuals.

A fit is an int64 array (WORDS), all zeros at first. Times are kept relative to those of the first answer, wherever
either clock stands: float64 holds a year of them to 4 ns.
"""

import math

import numpy as np

from haptic_device.jit import kernel, njit

ENOUGH = 5  # answers that make a fit
FORGET = 1.5e9  # [ns]
LATE = 2
AGEING = 0.02
LEAST_ROUND = 1000  # [ns] below which round trips are not told apart
MOST_SKEW = 250e-6
STEADY = (
    1e15  # [ns²] of squared times that say "no skew": answers that jitter by 10 µs tell skews of 200 ppm after 50 ms
)
MARGIN = 10_000.0  # [ns] by which a fit may lie outside of an answer's bounds, beside the residuals
FARTHEST = 1 << 61  # [ns] of a time that a device may tell

LINE = 9  # words of a line, of which there are two: the fit, and what contradicts it
HOST, OFFSET, COUNT, LAST, WEIGHT, TIME, MIDDLE, SQUARES, PRODUCTS = range(LINE)  # the last five are float64 bits
SLOPE, RESIDUAL, LEAST, DOUBT = range(2 * LINE, 2 * LINE + 4)  # float64 bits
STEPS = 2 * LINE + 4
WORDS = 2 * LINE + 5

REFUSED, LEFT_OUT, TAKEN = -1, 0, 1


@kernel
def restart(fit):
    """Forgets all but the number of steps."""
    for i in range(STEPS):
        fit[i] = 0


@kernel
def known(fit):
    """Whether there have been enough answers."""
    return fit[COUNT] >= ENOUGH


@kernel
def skew(fit):
    """Of the device's clock: by how much of a second it gains in one."""
    return fit.view(np.float64)[SLOPE]


@kernel
def error(fit):
    """Half-width of what is not known of the device's clock [ns], as defined above."""
    reals = fit.view(np.float64)
    return np.int64(math.ceil(max(reals[RESIDUAL] + reals[LEAST] / 2.0, reals[DOUBT])))


@kernel
def to_device(fit, host):
    """Time of the device's clock at this time of the host's [ns]."""
    reals, passed = fit.view(np.float64), host - fit[HOST]
    rest = reals[MIDDLE] + reals[SLOPE] * (np.float64(passed) - reals[TIME])
    return host + fit[OFFSET] + np.int64(math.floor(rest + 0.5))


@kernel
def to_host(fit, device):
    """Time of the host's clock at this time of the device's [ns]: to_device backwards."""
    reals, passed = fit.view(np.float64), device - fit[OFFSET] - fit[HOST]
    slope, middle = reals[SLOPE], reals[MIDDLE]
    rest = middle + slope * (np.float64(passed) - middle - reals[TIME]) / (1.0 + slope)
    return device - fit[OFFSET] - np.int64(math.floor(rest + 0.5))


@kernel
def answer(fit, t1, t2, t3, t4):
    """Takes an answer in; returns TAKEN, LEFT_OUT (late, or it contradicts the fit) or REFUSED (it cannot be one)."""
    if not -FARTHEST < t2 <= t3 < FARTHEST or t4 - t1 < t3 - t2:
        return REFUSED
    reals = fit.view(np.float64)
    round_trip, host = np.float64(max(LEAST_ROUND, t4 - t1 - (t3 - t2))), t1 + (t4 - t1) // 2
    reals[LEAST] = round_trip if reals[LEAST] == 0.0 else min(round_trip, reals[LEAST] * (1.0 + AGEING))
    late, residual = round_trip > LATE * reals[LEAST], 0.0
    if fit[COUNT] > 0:
        most, least = np.float64(t2 - to_device(fit, t1)), np.float64(t3 - to_device(fit, t4))
        residual, margin = (most + least) / 2.0, MARGIN + reals[RESIDUAL]
        if fit[COUNT] >= ENOUGH and (most < -margin or least > margin):
            return _contradict(fit, host, t2 - t1, t3 - t4, residual, 0.0 if late else _weight(reals, round_trip))
    if late:
        return LEFT_OUT
    _add(fit[:LINE], host, t2 - t1, t3 - t4, _weight(reals, round_trip))
    _forget_doubt(fit)
    reals[SLOPE] = _slope(reals)
    reals[RESIDUAL] = max(abs(residual), 0.99 * reals[RESIDUAL])
    return TAKEN


@njit
def _weight(reals, round_trip):
    """An answer's share: what it took longer than the least may all lie on one way."""
    excess = (round_trip - reals[LEAST]) / (reals[LEAST] / 4.0)
    return 1.0 / (1.0 + excess * excess)


@njit
def _slope(reals):
    return min(MOST_SKEW, max(-MOST_SKEW, reals[PRODUCTS] / (reals[SQUARES] + STEADY)))


@njit
def _contradict(fit, host, most, least, residual, weight):
    """Counts an answer that the fit cannot be true with; the line through ENOUGH of them becomes the fit."""
    reals = fit.view(np.float64)
    reals[DOUBT] = abs(residual)
    if weight > 0.0:
        _add(fit[LINE : 2 * LINE], host, most, least, weight)
    if fit[LINE + COUNT] >= ENOUGH:
        fit[:LINE] = fit[LINE : 2 * LINE]
        _forget_doubt(fit)
        reals[SLOPE] = _slope(reals)
        fit[STEPS] += 1
    return LEFT_OUT


@njit
def _forget_doubt(fit):
    fit[LINE : 2 * LINE] = 0
    fit[DOUBT] = 0


@njit
def _add(line, host, most, least, weight):
    """Adds an answer to a line's weighted means and sums of squares; those before fade by the time between."""
    reals = line.view(np.float64)
    if line[COUNT] == 0:
        line[HOST], line[OFFSET], line[LAST] = host, least + (most - least) // 2, host
    time = np.float64(host - line[HOST])
    measured = (np.float64(most - line[OFFSET]) + np.float64(least - line[OFFSET])) / 2.0
    kept = math.exp(-np.float64(max(0, host - line[LAST])) / FORGET)
    line[COUNT], line[LAST] = line[COUNT] + 1, host
    reals[WEIGHT] = kept * reals[WEIGHT] + weight
    moved, risen = time - reals[TIME], measured - reals[MIDDLE]
    reals[TIME] += weight / reals[WEIGHT] * moved
    reals[MIDDLE] += weight / reals[WEIGHT] * risen
    reals[SQUARES] = kept * reals[SQUARES] + weight * moved * (time - reals[TIME])
    reals[PRODUCTS] = kept * reals[PRODUCTS] + weight * moved * (measured - reals[MIDDLE])
