# SPDX-License-Identifier: Apache-2.0
"""The even times of a film, and what was so at each of them."""

import math

import numpy as np
import numpy.typing as npt

RATE = 60.0  # pictures a second
MOST = 36_000  # pictures: of what is longer than ten minutes there are fewer a second
STALE = 0.5  # [s] after which what was said counts no more
Array = npt.NDArray[np.float64]


class Clock:
    """The even times of a film from begin to end [s]."""

    def __init__(self, begin: float, end: float) -> None:
        self.rate = min(RATE, MOST / max(end - begin, 1.0))
        self.times = begin + np.arange(math.floor((end - begin) * self.rate) + 1) / self.rate

    def nearest(self, times: Array) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
        """Of each picture, which of these times [s], rising, is nearest, and whether it counts: what was said counts
        for STALE, what is said later does not yet."""
        if not len(times):
            return np.zeros(len(self.times), np.intp), np.zeros(len(self.times), bool)
        right = np.clip(np.searchsorted(times, self.times), 1, max(1, len(times) - 1))
        left = right - 1
        right = np.minimum(right, len(times) - 1)
        since, until = self.times - times[left], times[right] - self.times
        found = np.where((np.abs(until) < np.abs(since)) & (until <= 1.0 / self.rate), right, left)
        age = self.times - times[found]
        return found, (age >= -1.0 / self.rate) & (age <= STALE)

    def at(self, times: Array, values: Array) -> Array:
        """The values nearest to each picture; NaN where there is none."""
        order = np.argsort(times, kind="stable")
        found, near = self.nearest(times[order])
        shown = np.full((len(self.times), *values.shape[1:]), np.nan)
        shown[near] = values[order[found[near]]]
        return shown

    def mean(self, times: Array, values: Array) -> Array:
        """The mean of what belongs to each picture, else what is nearest."""
        shown, (place, known) = self.at(times, values), self._cells(times, values)
        count = np.bincount(place, minlength=len(self.times))
        total = np.bincount(place, known, len(self.times))
        return np.divide(total, count, out=shown, where=count > 0)

    def largest(self, times: Array, values: Array) -> Array:
        """The largest of what belongs to each picture, else what is nearest."""
        shown, (place, known) = self.at(times, values), self._cells(times, values)
        most = np.full(len(self.times), -np.inf)
        np.maximum.at(most, place, known)
        return np.where(np.isfinite(most), most, shown)

    def _cells(self, times: Array, values: Array) -> tuple[npt.NDArray[np.intp], Array]:
        place = np.round((times - self.times[0]) * self.rate)
        chosen = np.isfinite(values) & (place >= 0) & (place < len(self.times))
        return place[chosen].astype(np.intp), values[chosen]
