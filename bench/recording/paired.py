# SPDX-License-Identifier: Apache-2.0
"""What a change adds to a figure, beside how much two runs alike differ in it."""

import itertools
import statistics


def compared(without, changed):
    """Values of pairs of runs in turn. Returns what is added, in the median over the pairs; the noise, which is how two
    runs alike differ (median over all twos of runs changed, and of runs without); and whether within it, in a word."""
    added = statistics.median(after - before for before, after in zip(without, changed, strict=True))
    alike = [abs(a - b) for runs in (without, changed) for a, b in itertools.combinations(runs, 2)]
    if not alike:
        return added, float("nan"), "one pair does not tell"
    noise = statistics.median(alike)
    return added, noise, "yes" if abs(added) <= noise else "NO"
