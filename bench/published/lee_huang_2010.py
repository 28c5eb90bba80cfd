# SPDX-License-Identifier: Apache-2.0
"""Passive set-position modulation keeps a spring to a late set position passive; the plain spring is not."""

from exchange_systems import one_axis

from adversary.exchange_search import Adversary, search

LATE = 5, 20, 100
"""Servo periods."""
EVALUATIONS = 600


def energy() -> dict[str, float]:
    """Energy [J] that a search over handle paths draws at delays of 5, 20 and 100 ms, the most of the three."""
    return {"plain spring": _drawn("direct"), "modulated": _drawn("pspm")}


def _drawn(method: str) -> float:
    """K = 1000 N/m, T = 1 ms."""
    return max(search(one_axis(method), Adversary(late=late), evaluations=EVALUATIONS, seed=1).energy for late in LATE)
