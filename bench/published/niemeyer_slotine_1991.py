# SPDX-License-Identifier: Apache-2.0
"""Wave variables keep a delayed exchange passive; positions sent as they are do not."""

from bench.published.late_exchange import drawn


def energy() -> dict[str, float]:
    """Energy drawn [J] at delays of 5, 20 and 100 ms, the most of the three."""
    return {"positions": drawn("direct"), "wave variables": drawn("wave")}
