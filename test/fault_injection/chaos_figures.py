# SPDX-License-Identifier: Apache-2.0
"""What an event of chaos did to the handle: forces, their fastest change, energy given, time to safe."""

from typing import NamedTuple

import numpy as np

from haptic_device.control.faults import name_of

MILLISECOND = 1e-3
NANO = 1e-9
AFTER = 0.3  # [s] that a force which has come back still counts as coming back


class Figures(NamedTuple):
    """force [N]: largest of the motor; change [N/ms]: its fastest, contacts included; step [N/ms]: its fastest while
    forces fade, return or rise; energy [J]: most given since a session began; safe [ms]: event to safety; recovered
    [s]: restart to engaged; wrong: what else is beyond a bound of the event. None: there is no such figure."""

    force: float
    change: float
    step: float | None
    energy: float
    safe: float | None = None
    recovered: float | None = None
    faults: tuple[str, ...] = ()
    note: str = ""
    wrong: tuple[str, ...] = ()


def figures(heard, safe=None, recovered=None, note="", wrong=()) -> Figures:
    """The figures of what was heard."""
    codes = [code for code in np.unique(heard.rows["fault"]) if code]
    force = np.hypot(heard.truths["motor"][:, 0], heard.truths["motor"][:, 1])
    return Figures(
        force=float(force.max(initial=0.0)),
        change=fastest_change(heard.rows) or 0.0,
        step=fastest_change(heard.rows, fading(heard.rows)),
        energy=energy_given(heard.truths, heard.sessions),
        safe=safe,
        recovered=recovered,
        faults=tuple(name_of(code) for code in codes),
        note=note,
        wrong=wrong,
    )


def fading(rows: np.ndarray) -> np.ndarray:
    """Ticks in which the coupling lets go or returns, or forces rise after enabling, and AFTER seconds behind them."""
    time = rows["deadline"] * NANO
    changing = (rows["exchange_fade"] < 1.0) | ((rows["engage"] > 0.0) & (rows["engage"] < 1.0))
    return time - np.maximum.accumulate(np.where(changing, time, -np.inf)) < AFTER


def fastest_change(rows: np.ndarray, counts=None) -> float | None:
    """Largest change of the motor's force (x, y) within 1 ms [N/ms], over ticks that are engaged and follow each other.

    A cut-off to zero is none: ticks with the motor off do not count, nor do those for which `counts` is False. None if
    no two ticks are left.
    """
    time, force, on = rows["deadline"] * NANO, rows["force_on_handle"][:, :2], rows["engage"] > 0.0
    on = on if counts is None else on & counts
    if len(rows) < 2:
        return None
    span = max(1, round(MILLISECOND / max(1e-6, float(np.median(np.diff(time))))))
    if len(rows) <= span:
        return None
    elapsed = time[span:] - time[:-span]
    off = np.concatenate([[0], np.cumsum(~on)])
    held = (off[span + 1 :] == off[: -span - 1]) & (elapsed > 0.0) & (elapsed < 1.5 * MILLISECOND)
    change = np.linalg.norm(force[span:] - force[:-span], axis=1)
    return float((change[held] * MILLISECOND / elapsed[held]).max()) if held.any() else None


def energy_given(truths: np.ndarray, sessions=()) -> float:
    """Most energy [J] the operator was given by the truth, counted from the beginning of each session on."""
    most, edges = 0.0, [-np.inf, *sessions, np.inf]
    for begin, end in zip(edges, edges[1:], strict=False):
        given = truths["energy"][(truths["time"] >= begin) & (truths["time"] < end)]
        if len(given):
            most = max(most, float((given - given[0]).max()))
    return most


def motor_off(truths: np.ndarray, since: float) -> float:
    """Milliseconds from `since` [s] to the last truth with the motor on after it; 0 if there is none."""
    on = truths["time"][np.any(truths["motor"] != 0.0, axis=1)]
    return float(max(0.0, on[on > since].max(initial=since) - since) / MILLISECOND)


def coupling_off(rows: np.ndarray) -> float:
    """Age [ms] of the oldest tool sample whose coupling still pulled."""
    pulled = (rows["exchange_fade"] > 0.0) & (rows["engage"] > 0.0)
    return float(rows["tool_age"][pulled].max(initial=0.0) / MILLISECOND)


def found_silent(rows: np.ndarray) -> float | None:
    """Milliseconds from the device's last sample to the tick that latched a fault; None if none did."""
    latched = np.flatnonzero((rows["fault"][1:] > 0) & (rows["fault"][:-1] == 0)) + 1
    if not len(latched):
        return None
    row = rows[latched[0]]
    return float((row["deadline"] - row["latched"]) * NANO / MILLISECOND)


def told_to_zero(rows: np.ndarray, called: float, flag: int) -> float | None:
    """Milliseconds from `called` [s] to the deadline of the first tick that has this flag and the motor at zero."""
    after = rows[(rows["deadline"] * NANO > called) & ((rows["command"].astype(int) & flag) != 0)]
    zero = after[~np.any(after["motor"] != 0.0, axis=1)]
    return float((zero["deadline"][0] * NANO - called) / MILLISECOND) if len(zero) else None


def ticks_to_zero(rows: np.ndarray, flag: int) -> int:
    """Ticks from the one that first has this flag in its command, it included, to the one with the motor at zero."""
    with_flag = rows[(rows["command"].astype(int) & flag) != 0]
    return 1 + int(np.any(with_flag["motor"] != 0.0, axis=1).sum())


def worst(several: list[Figures]) -> Figures:
    """The worst of each figure."""

    def most(name):
        values = [value for each in several if (value := getattr(each, name)) is not None]
        return max(values) if values else None

    numbers = {name: most(name) for name in ("force", "change", "step", "energy", "safe", "recovered")}
    faults, wrong = (
        tuple(sorted({name for each in several for name in getattr(each, field)})) for field in ("faults", "wrong")
    )
    return Figures(**numbers, faults=faults, note=several[-1].note, wrong=wrong)
