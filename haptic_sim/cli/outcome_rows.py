# SPDX-License-Identifier: Apache-2.0
"""What came of a run in words, as `haptic demo` shows it."""

from collections.abc import Iterator
from typing import Any

from haptic_device.control.withheld import TABLE
from haptic_device.digits import amount, plain
from haptic_device.withheld_time import SHORT

FIGURES = {  # key: (words, scale to the unit, unit)
    "seconds": ("length of the run", 1.0, "s"),
    "startup_s": ("start-up", 1.0, "s"),
    "servo rate_hz": ("servo rate", 1.0, "Hz"),
    "servo ticks": ("servo ticks", 1, ""),
    "servo missed": ("servo ticks missed", 1, ""),
    "servo late_device": ("servo ticks without a new device sample", 1, ""),
    "servo lateness_us p50": ("servo lateness, median", 1e-6, "s"),
    "servo lateness_us p99": ("servo lateness, 99 %", 1e-6, "s"),
    "servo lateness_us p999": ("servo lateness, 99.9 %", 1e-6, "s"),
    "servo lateness_us max": ("servo lateness, largest", 1e-6, "s"),
    "servo compute_us p50": ("time to compute a tick, median", 1e-6, "s"),
    "servo compute_us p99": ("time to compute a tick, 99 %", 1e-6, "s"),
    "servo compute_us max": ("time to compute a tick, largest", 1e-6, "s"),
    "servo realtime": ("scheduling of the servo", 1, ""),
    "exchange rate_hz": ("exchange rate", 1.0, "Hz"),
    "exchange sent": ("handle samples sent", 1, ""),
    "exchange answered": ("handle samples answered", 1, ""),
    "exchange age_ms p50": ("age of the tool sample, median", 1e-3, "s"),
    "exchange age_ms p99": ("age of the tool sample, 99 %", 1e-3, "s"),
    "exchange age_ms max": ("age of the tool sample, largest", 1e-3, "s"),
    "simulation method": ("simulation method", 1, ""),
    "simulation why": ("why this method", 1, ""),
    "simulation waited_s": ("time left out by the simulation", 1.0, "s"),
    "energy_j given_to_operator_max": ("energy given to the hand, largest", 1.0, "J"),
    "energy_j given_to_operator_end": ("energy given to the hand, at the end", 1.0, "J"),
    "energy_j tool_port_end": ("energy given to the tool, at the end", 1.0, "J"),
    "contact max_force_n": ("strongest contact", 1.0, "N"),
    "contact max_on_hand_n": ("strongest on the hand", 1.0, "N"),
    "contact max_penetration_m": ("deepest overlap", 1.0, "m"),
    "residual rms_n": ("mismatch of handle and tool force, RMS", 1.0, "N"),
    "residual explained_by_age_n": ("of it from the age of the tool sample", 1.0, "N"),
    "residual unexplained_n": ("of it unexplained", 1.0, "N"),
    **{f"withheld_s {each.name}": (f"force withheld: {each.cause}", 1.0, "s") for each in TABLE},
    "withheld_s tool_port": (f"force withheld: {SHORT}", 1.0, "s"),
}
FIRST = (  # what a reader wants first, in this order
    "contact max_on_hand_n",
    "contact max_force_n",
    "energy_j given_to_operator_max",
    "servo rate_hz",
    "servo missed",
    "servo lateness_us p50",
    "servo lateness_us p99",
    "exchange sent",
    "exchange answered",
    "startup_s",
)
ANSWER = ("scene", "done", "why", "task", "result", "result_greatest", "faults")
LEFT_OUT = (*ANSWER, "exchange cause", "late", "bag", "report")
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
    """(words, value with unit) of each figure of `haptic demo --json` that is none of the answer, in its order, without
    sentences; or of those that a reader wants first."""
    values = dict(_flat(found))
    for key in values if everything else filter(values.__contains__, FIRST):
        words, scale, unit = FIGURES.get(key, (key.replace("_", " "), 1, ""))
        yield words, _text(values[key], scale, unit)


def _flat(found, prefix=""):
    for name, value in found.items():
        key = prefix + name
        if key in LEFT_OUT or (value is None and not prefix):
            continue
        if isinstance(value, dict):
            yield from _flat(value, f"{key} ")
        else:
            yield key, value


def _text(value, scale, unit) -> str:
    if isinstance(value, int | float):
        return amount(value * scale, unit)
    return "unknown" if value is None else str(value)
