# SPDX-License-Identifier: Apache-2.0
"""What came of a run in words, as `haptic demo` shows it."""

from collections.abc import Iterator
from typing import Any

from haptic_device.control.withheld import SHORT, TABLE
from haptic_device.digits import amount, plain
from haptic_display.run.report.quantities import QUANTITIES
from haptic_display.run.report.summary import PORT

WORDS = {  # of a value among several, after those of all
    "p50": ", median",
    "p99": ", 99 %",
    "p999": ", 99.9 %",
    "max": ", largest",
    "rms_n": "mismatch of handle and tool force, RMS",
    "explained_by_age_n": "of it from the age of the tool sample",
    "unexplained_n": "of it unexplained",
    **{each.name: f": {each.cause}" for each in TABLE},
    PORT: f": {SHORT}",
}
FEW = ("p50", "p99")  # of several values, where not all are told
_SI = {"µs": (1e-6, "s"), "ms": (1e-3, "s")}
SHARE = 3  # decimals of a measure; the rest is rounding


def answer(found: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """(words, value) of the scene's task, what the scene measures, and the faults."""
    if found["task"]:
        yield "task", found["task"]
    for name, last in found["result"].items():
        told = (plain(round(each, SHARE)) for each in (last, found["result_greatest"].get(name, last)))
        yield name.replace("_", " "), "last {}, greatest {}".format(*told)
    yield "faults", ", ".join(found["faults"]) or "none"


def rows(found: dict[str, Any], everything: bool = True) -> Iterator[tuple[str, str]]:
    """(words, value with unit) of each figure of `haptic demo --json` that is none of the answer, without sentences; or
    of those that a reader wants first, in their order."""
    chosen = QUANTITIES if everything else sorted((one for one in QUANTITIES if one.first), key=lambda one: one.first)
    for one in chosen:
        *group, name = one.key.split() or [""]
        values = found.get(group[0]) or {} if group else found
        value = values.get(name)
        if isinstance(value, dict) and (one.words or one.unit):
            told = value if everything else FEW
            yield from ((one.words + WORDS.get(each, f" {each}"), _text(value[each], one.unit)) for each in told)
        elif one.words and (value is not None or group and name in values):
            yield one.words, _text(value, one.unit)


def _text(value: Any, unit: str) -> str:
    if isinstance(value, int | float):
        scale, unit = _SI.get(unit, (1, unit))
        return amount(value * scale, unit)
    return "unknown" if value is None else str(value)
