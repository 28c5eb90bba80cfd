# SPDX-License-Identifier: Apache-2.0
"""What came of a run: its figures from the bag, and whether its job was done."""

import math
from functools import cached_property
from itertools import pairwise
from statistics import median

import numpy as np

from haptic_device.control.faults import FAULTS
from haptic_device.digits import plain
from haptic_device.recording.bag_contents import Recording, Records
from haptic_device.recording.status import number
from haptic_device.theory.quantity import Array, Flags
from haptic_display.fault_sentence import what_to_do
from haptic_display.run.report import quantities, summary
from haptic_display.run.report.run import Run
from haptic_sim.exchange.left_out_time import CHEAPER, NOTICED, QUIETER, SHARE, takes
from haptic_sim.scene.language import Task

ANSWERED = 0.9  # of the handle samples sent, for scenes without a goal of their own
LATE = 0.01  # share of the samples that may come late without a word


class Engaged(Run):
    """A run of the ticks with the motor engaged alone. Raises ValueError where there are fewer than two."""

    @cached_property
    def rows(self) -> Records:
        return summary.engaged_rows(self.recording.trace)


def figures(recording: Recording, started: float, lossy: bool = False) -> dict:
    """Everything that `--json` reports of a recorded run; `started` is the command's start on CLOCK_MONOTONIC [s].

    lossy: a relay loses handle samples, or has one overtake another, so that nobody else is to blame for it.
    Raises ValueError if the bag lacks what the figures are read from.
    """
    if reason := recording.lacks("handle"):
        raise ValueError(reason)
    run = Engaged(recording, "", started=started)
    found = quantities.figures(run)
    servo, exchange, waited = found["servo"], found["exchange"], found["simulation"]["waited_s"]
    exchange["cause"] = "" if lossy else cause(servo, exchange, _load(recording), waited, run.length)
    return {"seconds": run.length, "late": late(servo, recording.last_values("haptic_driver"))} | found


def nothing() -> dict:
    """The same keys for a run that left no figures."""
    groups = (one.key.split()[0] for one in quantities.QUANTITIES if one.key)
    none = dict.fromkeys(("seconds", "late", *groups, "report", "task"))
    return none | {"seconds": 0.0, "late": "", "result": {}, "result_greatest": {}, "faults": []}


def late(servo: dict, driver: dict[str, str]) -> str:
    """That the device's samples come late, and whether its damping bears it, a sentence; "" if they do not.

    driver: the last values of its diagnostics.
    """
    share = (servo["late_device"] or 0) / max(1, servo["ticks"] or 0)
    margin, lateness = number(driver.get("passivity_margin", "")), number(driver.get("lateness_counted_us", ""))
    if not share > LATE:
        return ""
    said = f"{100 * share:.0f} % of its samples came after half a period"
    if margin < 0.0:
        said += f"; forces act {lateness * 1e-3:.3g} ms late, for which {-margin:.3g} N s/m of damping are missing"
    return f"the device is late: {said}; take a lower --rate or softer gains, and see haptic status"


def cause(servo: dict, exchange: dict, load: float, waited: float | None, seconds: float) -> str:
    """Why handle samples stayed unanswered or the world left time out, a sentence; "" if it is not worth a word.

    load: time that the world takes for a second of its own [s], NaN where it is not known; waited: time left out [s].
    """
    sent, answered, waited = exchange["sent"], exchange["answered"], waited or 0.0
    if answered >= (1.0 - NOTICED) * sent and waited <= NOTICED * seconds:
        return ""
    came = f"{answered} of {sent} handle samples were answered and the world left out {waited:.2f} s"
    said = takes(load, 1.0 / exchange["rate_hz"])
    if load > SHARE:
        return f"the world is too dear: {came}, {said}; {CHEAPER}"
    late, age, missed = servo["lateness_us"], exchange["age_ms"], servo["missed"]
    woke = f"the servo woke up {late['p99']:.0f} µs late (99 %; at most {late['max']:.0f}) and missed {missed} ticks"
    old = f"tool samples were {age['p99']:.3g} ms old (99 %; at most {age['max']:.3g})"
    return f"the machine was late: {came}, {said}; {woke}, {old}; {QUIETER}"


def not_done(found: dict, unended: str = "", share: float = ANSWERED) -> str:
    """Why the job was not done, a sentence with what it came to and the limit; "" if it was done.

    Done is no fault, and the scene's goals reached, or where it has none a run that ended as asked (`unended`: why it
    did not, or "") with this share of the handle samples answered.
    """
    if found["faults"]:
        said = [what_to_do(name) for name in found["faults"] if name in FAULTS and not unended]
        said += [name for name in found["faults"] if name not in FAULTS]
        return "; ".join(dict.fromkeys(filter(None, [unended, *said])))
    if not found["exchange"]:
        return unended or "the run left no figures"
    if goals := {name: found["result"][name] for name in summary.GOALS if name in found["result"]}:
        missed = {name: value for name, value in goals.items() if value < summary.REACHED}
        said = [f"{name} came to {value:.4g}, and {summary.REACHED:g} is the least" for name, value in missed.items()]
        return "; ".join(filter(None, [unended, *said])) if missed else ""
    return unended or _unanswered(share=share, **found["exchange"])


def task_of(task: Task | None, found: dict) -> str | None:
    """How far the task of the scene came at its best: "done", or what fell short; None where there is none."""
    if task is None or not found["exchange"]:
        return None
    greatest, felt = found["result_greatest"], (found["contact"] or {}).get("max_on_hand_n")
    came = [(name, "", greatest.get(name, math.nan), share) for name, share in task.done.items()]
    came += [] if task.force is None else [("force on the hand", "N", math.nan if felt is None else felt, task.force)]
    short = [
        f"{name} came to {plain(value, unit)}; {plain(least, unit)} is needed"
        for name, unit, value, least in came
        if not value >= least
    ]
    return f"not done: {', '.join(short)}" if short else "done"


def done_at(run: Run, task: Task | None) -> list[tuple[float, str]]:
    """When the task was done [s from the first tick], and by what; empty if it was not, or the bag does not tell."""
    came: dict[str, float] = {}
    try:
        for name, share in task.done.items() if task else ():
            state = run.recording.joint("scene/state")
            said = f"{name.replace('_', ' ')} {plain(100 * share)} %"
            came[said] = _first(run.since(state.stamp), state.entry(f"result.{name}") >= share)
        if task and task.force is not None:
            felt = np.hypot(*run.rows["force_on_handle"][:, :2].T)
            came[f"{plain(task.force, 'N')} on the hand"] = _first(run.seconds, felt >= task.force)
    except ValueError:
        return []
    return [(max(came.values()), f"task done: {', '.join(came)}")] if came and math.isfinite(sum(came.values())) else []


def _first(times: Array, there: Flags) -> float:
    return float(times[there.argmax()]) if there.any() else math.nan


def _unanswered(sent: int, answered: int, share: float, **_) -> str:
    least = max(1, math.ceil(share * sent))
    return "" if answered >= least else f"{answered} of {sent} handle samples were answered, and {least} are the least"


def _load(recording: Recording) -> float:
    """What the world took for a second of its own [s]: median of what the simulation said when time had been left out,
    or of all that it said; NaN if it has not."""
    names = ("world_load", "waited_s")
    values = [status.values for status in recording.statuses("haptic_simulation")]
    said = [tuple(number(each.get(name, "")) for name in names) for each in values]
    grown = [load for (_, before), (load, waited) in pairwise(said) if waited > before and not math.isnan(load)]
    known = grown or [load for load, _ in said if not math.isnan(load)]
    return median(known) if known else math.nan
