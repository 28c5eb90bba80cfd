# SPDX-License-Identifier: Apache-2.0
"""Passive set-position modulation keeps a spring to a late set position passive; the plain spring is not."""

from exchange_systems import one_axis

from adversary.exchange_search import Adversary, search

LATE = 5, 20, 100
"""Servo periods."""
EVALUATIONS = 600
PLENTY = 1e6  # [J]


def energy() -> dict[str, float]:
    """Energy [J] that a search over handle paths draws at delays of 5, 20 and 100 ms, the most of the three."""
    return {"plain spring": _drawn("direct", PLENTY), "modulated": _drawn("pspm")}


def _drawn(method: str, paid: float = 0.0) -> float:
    """K = 1000 N/m, T = 1 ms; paid: energy [J] of an account that shortens nothing, 0 for that of the display."""
    settings = one_axis(method)
    if paid > 0.0:
        settings["exchange"]["budget"] = settings["exchange"]["tank"] = paid
    return max(search(settings, Adversary(late=late), evaluations=EVALUATIONS, seed=1).energy for late in LATE)
