# SPDX-License-Identifier: Apache-2.0
"""Offset and skew of a device's clock against the host's, from questions and answers.

An answer is four times [ns]: t1 the host asked, t2 the device heard, t3 the device answered, t4 the host heard. The
device's clock less the host's was then at most t2 − t1 at t1, and is at least t3 − t4 at t4, however the delays were
shared: these are the answer's bounds. The middle is taken as measured. A straight line is fitted to these by least
squares, in which an answer counts less the older it is (by a factor e each FORGET) and the longer it was on its way.
Answers with more than LATE times the least round trip are left out; that least grows by a share AGEING with each
answer, so that a line that has become slower is taken as it is in the end. If the fit lies outside the bounds of one
that is left out, the nearer bound counts as measured. In the end the fit moves to the bounds of the answer.

By how much the device's clock gains lies between bounds too, those of an answer and of a reference one to two times
RENEW before it; the slope of the fit is kept within them. So a clock that is much too fast is followed from the first
answers on, and jitter does not make one of a clock that is right.

A fit that lies outside an answer's bounds by more than a margin cannot be true: after ENOUGH such answers without one
that fits, the line through these takes the place of the old one. That is a step of the clock only if it lies outside by
more than the last answer that was taken left unknown; else the fit was not good yet.

The error is what the last answer leaves, also one that is left out: how far its bounds are from the fit, and the
bounds of the slope times the time since. So it is never less than the truth when an answer has come, whatever the
delays; a step shows with the first answer after it.

`trouble` judges the clock: TOLERATED, STEP_FELT and JITTER_FELT are what a servo at 1 kHz bears.

A fit is an int64 array (WORDS), all zeros at first. Times are kept relative to those of the first answer, wherever
either clock stands: float64 holds a year of them to 4 ns.
"""

import math

import numpy as np

from haptic_device.jit import kernel, njit

ENOUGH = 5  # answers that make a fit
FORGET = 1.5e9  # [ns]
LATE = 4
AGEING = 0.02
LEAST_ROUND = 1000  # [ns] below which round trips are not told apart
SLOWEST, FASTEST = -0.9999, 1e6  # skews between which a clock is followed, so that its skew can be told
RENEW = 1_000_000_000  # [ns] between references
STEADY = (
    1e15  # [ns²] of squared times that say "no skew": answers that jitter by 10 µs tell skews of 200 ppm after 50 ms
)
MARGIN = 10_000.0  # [ns] by which a fit may lie outside of an answer's bounds, beside the residuals
FARTHEST = 1 << 61  # [ns] of a time that a device may tell

TOLERATED = 1e-3  # skew of a clock that is good enough
STEP_FELT = 100_000.0  # [ns] by which a fit lies outside of an answer's bounds where the clock has been set
JITTER_FELT = 500_000.0  # [ns] of the error on average over 16 answers, which then tell the clock too badly
FINE, DRIFT, STEP, JITTER = range(4)  # troubles

LINE = 17  # words of a line, of which there are two: the fit, and what contradicts it
HOST, OFFSET, COUNT, LAST, WEIGHT, TIME, MIDDLE, SQUARES, PRODUCTS = range(9)  # the last five are float64 bits
OLD, YOUNG = 9, 13  # references: an answer's four times each
SLOPE, RESIDUAL, LEAST, DOUBT, LOW, HIGH, WIDTH, MEAN, SURE = range(2 * LINE, 2 * LINE + 9)  # float64 bits
SINCE, SURE_AT = 2 * LINE + 9, 2 * LINE + 10  # t1 of the last answer, and of the last that was taken
STEPS, STEPPED = 2 * LINE + 11, 2 * LINE + 12  # STEPPED: the last step [ns]
WORDS = 2 * LINE + 13

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
def error(fit, at):
    """Half-width of what is not known of the device's clock at this time of the host [ns], as defined above."""
    return np.int64(math.ceil(_grown(fit, fit.view(np.float64)[WIDTH], fit[SINCE], at)))


@kernel
def steady_error(fit, at):
    """The same by the last answer that was taken, which a late one after it does not make worse. While answers
    contradict the fit it is the error."""
    reals, known_by_last = fit.view(np.float64), error(fit, at)
    if fit[LINE + COUNT] > 0 or reals[DOUBT] != 0.0:
        return known_by_last
    return min(known_by_last, np.int64(math.ceil(_grown(fit, reals[SURE], fit[SURE_AT], at))))


@njit
def _grown(fit, width, since, at):
    """What an answer at `since` left unknown, with what the slope's bounds have added up to then."""
    reals = fit.view(np.float64)
    rate = max(abs(reals[HIGH] - reals[SLOPE]), abs(reals[SLOPE] - reals[LOW]))
    return width + rate * np.float64(max(0, at - since)) + 4.0  # as exact as float64 is


@kernel
def trouble(fit):
    """What makes the clock not good enough: DRIFT, STEP (not followed yet), JITTER of answers, or FINE."""
    reals = fit.view(np.float64)
    if not known(fit):
        return FINE
    if reals[LOW] > TOLERATED or reals[HIGH] < -TOLERATED:
        return DRIFT
    if abs(reals[DOUBT]) > STEP_FELT:
        return STEP
    return JITTER if reals[MEAN] > JITTER_FELT else FINE


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
    round_trip = np.float64(max(LEAST_ROUND, t4 - t1 - (t3 - t2)))
    reals[LEAST] = round_trip if reals[LEAST] == 0.0 else min(round_trip, reals[LEAST] * (1.0 + AGEING))
    late, residual, outside = round_trip > LATE * reals[LEAST], 0.0, 0.0
    if fit[COUNT] > 0:
        most, least = np.float64(t2 - to_device(fit, t1)), np.float64(t3 - to_device(fit, t4))
        residual, outside = (most + least) / 2.0, max(least, 0.0) + min(most, 0.0)
    contradicts = known(fit) and abs(outside) > MARGIN + reals[RESIDUAL]
    if contradicts:
        _contradict(fit, t1, t2, t3, t4, outside, 0.0 if late else _weight(reals, round_trip))
    elif late and outside != 0.0:
        _add(fit[:LINE], t1, t2, t3, t4, 1.0, outside - residual)
        _turn(fit, t1, t2, t3, t4)
    elif not late:
        _add(fit[:LINE], t1, t2, t3, t4, _weight(reals, round_trip), 0.0)
        _forget_doubt(fit)
        _turn(fit, t1, t2, t3, t4)
        reals[RESIDUAL] = max(abs(residual), 0.99 * reals[RESIDUAL])
    taken = LEFT_OUT if late or contradicts else TAKEN
    _leave(fit, t1, t2, t3, t4, taken, contradicts)
    return taken


@njit
def _leave(fit, t1, t2, t3, t4, taken, contradicts):
    """Moves the fit to the bounds of an answer that does not contradict it; notes what the answer leaves unknown."""
    reals, most, least = fit.view(np.float64), t2 - to_device(fit, t1), t3 - to_device(fit, t4)
    moved = 0 if contradicts else max(least, 0) + min(most, 0)
    reals[MIDDLE] += np.float64(moved)
    width = np.float64(max(most - moved, moved - least, 0))
    reals[WIDTH], fit[SINCE] = width, t1
    if taken == TAKEN:
        reals[SURE], fit[SURE_AT] = width, t1
    if not contradicts:  # no more of each: a stall makes some that are very late
        reals[MEAN] += (min(width, 2.0 * JITTER_FELT) - reals[MEAN]) / min(16, fit[COUNT])


@njit
def _weight(reals, round_trip):
    """An answer's share: what it took longer than the least may all lie on one way."""
    excess = (round_trip - reals[LEAST]) / (reals[LEAST] / 4.0)
    return 1.0 / (1.0 + excess * excess)


@njit
def _turn(fit, t1, t2, t3, t4):
    """The slope of the fit's line, within the bounds that this answer and the reference leave."""
    reals, old = fit.view(np.float64), fit[OLD:YOUNG]
    low, high = SLOWEST, FASTEST
    if t1 > old[3]:
        low = max(low, np.float64(t3 - old[1] - (t4 - old[0])) / np.float64(t4 - old[0]))
        high = max(low, min(high, np.float64(t2 - old[2] - (t1 - old[3])) / np.float64(t1 - old[3])))
    reals[LOW], reals[HIGH] = low, high
    reals[SLOPE] = min(high, max(low, reals[PRODUCTS] / (reals[SQUARES] + STEADY)))


@njit
def _contradict(fit, t1, t2, t3, t4, outside, weight):
    """Counts an answer that the fit cannot be true with; the line through ENOUGH of them becomes the fit."""
    reals = fit.view(np.float64)
    if abs(outside) > _grown(fit, reals[SURE], fit[SURE_AT], t4):
        reals[DOUBT] = outside
    if weight > 0.0:
        _add(fit[LINE : 2 * LINE], t1, t2, t3, t4, weight, 0.0)
    if fit[LINE + COUNT] >= ENOUGH:
        fit[:LINE], doubt = fit[LINE : 2 * LINE], reals[DOUBT]
        _forget_doubt(fit)
        _turn(fit, t1, t2, t3, t4)
        if doubt != 0.0 and trouble(fit) != DRIFT:
            fit[STEPS], fit[STEPPED] = fit[STEPS] + 1, np.int64(doubt)


@njit
def _forget_doubt(fit):
    fit[LINE : 2 * LINE] = 0
    fit[DOUBT] = 0


@njit
def _add(line, t1, t2, t3, t4, weight, shift):
    """Adds an answer to a line's weighted means and sums of squares; those before fade by the time between.

    shift: what is taken as measured, less the middle of the answer's bounds [ns].
    """
    reals, host, most, least = line.view(np.float64), t1 + (t4 - t1) // 2, t2 - t1, t3 - t4
    if line[COUNT] == 0:
        line[HOST], line[OFFSET], line[LAST] = host, least + (most - least) // 2, host
    if line[COUNT] == 0 or t1 - line[YOUNG] > RENEW:
        line[OLD:YOUNG] = line[YOUNG : YOUNG + 4]
        line[YOUNG], line[YOUNG + 1], line[YOUNG + 2], line[YOUNG + 3] = t1, t2, t3, t4
        if line[COUNT] == 0:
            line[OLD:YOUNG] = line[YOUNG : YOUNG + 4]
    time = np.float64(host - line[HOST])
    measured = (np.float64(most - line[OFFSET]) + np.float64(least - line[OFFSET])) / 2.0 + shift
    kept = math.exp(-np.float64(max(0, host - line[LAST])) / FORGET)
    line[COUNT], line[LAST] = line[COUNT] + 1, host
    reals[WEIGHT] = kept * reals[WEIGHT] + weight
    moved, risen = time - reals[TIME], measured - reals[MIDDLE]
    reals[TIME] += weight / reals[WEIGHT] * moved
    reals[MIDDLE] += weight / reals[WEIGHT] * risen
    reals[SQUARES] = kept * reals[SQUARES] + weight * moved * (time - reals[TIME])
    reals[PRODUCTS] = kept * reals[PRODUCTS] + weight * moved * (measured - reals[MIDDLE])
