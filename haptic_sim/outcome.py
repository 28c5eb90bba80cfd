# SPDX-License-Identifier: Apache-2.0
"""What came of a run: its figures from the bag, and whether its job was done."""

import math

from haptic_device.analysis.report.summary import (
    energy_figures,
    engaged_rows,
    exchange_figures,
    faults,
    first_command,
    residual_figures,
    servo_figures,
)
from haptic_device.recording.bag_contents import Recording
from haptic_device.status import number

INSERTED = 0.95  # of the hole's depth
ANSWERED = 0.9  # of the handle samples sent, for scenes without a goal of their own
_NOTHING = ("servo", "exchange", "simulation", "energy_j", "contact", "report", "startup_s")


def figures(recording: Recording, started: float) -> dict:
    """Everything that `--json` reports of a recorded run; `started` is the command's start on CLOCK_MONOTONIC [s].

    Raises ValueError if the bag lacks what the figures are read from.
    """
    rows = engaged_rows(recording.trace)
    driver, simulation = (recording.last_values(node) for node in ("haptic_driver", "haptic_simulation"))
    return {
        "seconds": float(rows["deadline"][-1] - rows["deadline"][0]) * 1e-9,
        "servo": servo_figures(rows) | {"realtime": driver.get("realtime")},
        "exchange": exchange_figures(recording, rows),
        "simulation": {name: simulation.get(name) for name in ("method", "why")},
        "energy_j": energy_figures(recording, rows),
        "contact": {
            "max_force_n": _number(simulation, "max_contact_force"),
            "max_penetration_m": _number(simulation, "max_penetration"),
        },
        "residual": residual_figures(recording, rows),
        "result": _result(simulation),
        "faults": faults(recording),
        "startup_s": first_command(recording.trace) - started,
    }


def nothing() -> dict:
    """The same keys for a run that left no figures."""
    return {"seconds": 0.0, **dict.fromkeys(_NOTHING), "residual": None, "result": {}, "faults": []}


def job_done(found: dict, ended: bool, share: float = ANSWERED) -> bool:
    """Whether the job was done: no fault, and the peg in its hole, or else a run that `ended` as asked, with this share
    of the handle samples answered."""
    if found["faults"] or not found["exchange"]:
        return False
    if "insertion_fraction" in found["result"]:
        return found["result"]["insertion_fraction"] >= INSERTED
    return ended and found["exchange"]["answered"] >= max(1, share * found["exchange"]["sent"])


def _result(values: dict[str, str]) -> dict[str, float]:
    said = {key.removeprefix("result."): number(value) for key, value in values.items() if key.startswith("result.")}
    return {key: value for key, value in said.items() if not math.isnan(value)}


def _number(values: dict[str, str], key: str) -> float | None:
    value = number(values.get(key, ""))
    return None if math.isnan(value) else value
