# SPDX-License-Identifier: Apache-2.0
"""Energy that the worst handle path found draws from an exchange method when the tool's samples come late."""

import functools

from exchange_systems import one_axis

from adversary.exchange_search import Adversary, search

LATE = 5, 20, 100
"""Servo periods."""
EVALUATIONS = 600


@functools.cache
def drawn(method: str) -> float:
    """Most energy [J] over these delays that a search over handle paths draws, K = 1000 N/m, T = 1 ms."""
    return max(search(one_axis(method), Adversary(late=late), evaluations=EVALUATIONS, seed=1).energy for late in LATE)
