# SPDX-License-Identifier: Apache-2.0
"""What diagnostics watch: figures with two limits each, one status a figure (`node: figure`), as monitors expect."""

import math
import time
from collections.abc import Iterable

from haptic_device.config.parameter_types import Watched


def statuses(node: str, watched: Iterable[Watched], figures: dict[str, float], values: dict) -> list[tuple]:
    """(name, level, message, values) of each figure that there is; NaN, where there is none yet, is ok."""
    return [_status(node, each, figures[each.name], values) for each in watched if each.name in figures]


def _status(node, each, figure, values):
    limits = {level: values[f"diagnostics.{each.name}.{level}"] for level in ("warn", "error")}
    said = "none yet" if math.isnan(figure) else f"{figure:.4g} {each.unit}".rstrip()
    return f"{node}: {each.name}", level_of(each, figure, **limits), said, {"value": f"{figure:.6g}", **limits}


def level_of(each: Watched, figure: float, warn: float, error: float) -> str:
    """`ok`, `warn` or `error`; a figure at its limit is still on the better side."""
    sign = 1.0 if each.error >= each.warn else -1.0
    if sign * figure > sign * error:
        return "error"
    return "warn" if sign * figure > sign * warn else "ok"


class Rates:
    """Growth of counts per second between two looks."""

    def __init__(self):
        self._known, self._looked = {}, time.monotonic()

    def of(self, **counts: float) -> dict[str, float]:
        """{name: growth per second since the last look}; NaN at the first, and after a count that began anew."""
        now = time.monotonic()
        elapsed, self._looked = now - self._looked, now
        rates = {name: (count - self._known.get(name, math.inf)) / max(elapsed, 1e-3) for name, count in counts.items()}
        self._known = counts
        return {name: rate if rate >= 0.0 else math.nan for name, rate in rates.items()}
