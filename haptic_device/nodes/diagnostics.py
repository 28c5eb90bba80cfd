# SPDX-License-Identifier: Apache-2.0
"""What diagnostics watch: figures with two limits each, one status a figure (`node: figure`), as monitors expect."""

import math
import time
from collections.abc import Iterable
from typing import NamedTuple

from haptic_device.parameter import Parameter

MOST = 1e9


class Watched(NamedTuple):
    """A figure, and the limits beyond which it is WARN and ERROR: above them, or below where error lies below warn."""

    name: str
    unit: str
    meaning: str
    warn: float
    error: float


DRIVER = (
    Watched("margin", "N s/m", "physical damping left in the worst direction, at the measured lateness", 0.0, -1.0),
    Watched("margin_theta", "N m s/rad", "the same about theta, of a device that turns", 0.0, -0.001),
    Watched("lateness", "s", "wake-up of the servo after its deadline, 99 %", 1e-4, 1e-3),
    Watched("compute", "s", "own work of a tick, 99 %", 5e-5, 1e-4),
    Watched("missed", "1/s", "ticks missed", 1.0, 100.0),
    Watched("age", "s", "age of the tool sample in use, 99 %", 0.01, 0.06),
    Watched("loss", "", "share of the handle samples that were not answered", 0.1, 0.5),
    Watched("energy", "J", "energy given to the operator, as the servo books it", 0.01, 0.1),
    Watched("warmth", "", "warmth of the warmest motor; at its limit for ever: 1", 0.6, 0.9),
    Watched("stall", "s", "longest time python, which hears services, stood still", 0.2, 1.0),
)
LOOPBACK = (
    Watched("energy", "J", "energy given to the operator, in truth", 0.01, 0.1),
    Watched("run_on", "1/s", "deadlines that passed without a write of the servo", 1.0, 100.0),
    Watched("late_writes", "1/s", "writes whose time had been integrated over", 1.0, 100.0),
)
SIMULATION = (
    Watched("compute", "s", "answering one handle sample, 99 %", 5e-4, 1e-3),
    Watched("refused", "1/s", "handle messages refused", 1.0, 100.0),
)


def parameters(watched: Iterable[Watched]) -> tuple[Parameter, ...]:
    """Two live parameters a figure: diagnostics.NAME.warn and diagnostics.NAME.error."""
    return tuple(
        Parameter(f"diagnostics.{each.name}.{level}", limit, each.unit, _meaning(each, level), -MOST, MOST, True)
        for each in watched
        for level, limit in (("warn", each.warn), ("error", each.error))
    )


def _meaning(each, level):
    return f"{level.upper()} {'above' if each.error >= each.warn else 'below'} this: {each.meaning}"


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
