# SPDX-License-Identifier: Apache-2.0
"""Passive set-position modulation keeps a spring to a late set position passive; the plain spring is not."""

from bench.published.late_exchange import drawn


def energy() -> dict[str, float]:
    """Energy drawn [J] at delays of 5, 20 and 100 ms, the most of the three."""
    return {"plain spring": drawn("direct"), "modulated": drawn("pspm")}
