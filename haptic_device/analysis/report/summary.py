# SPDX-License-Identifier: Apache-2.0
"""The figures of one run, read from its recording: servo, exchange, energy, and what the two coupling forces differ by.

All figures are of the ticks with the motor engaged (`engage` > 0).
"""

from itertools import chain, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from haptic_device.analysis.quantity import Array
from haptic_device.control import exchange_samples
from haptic_device.control.faults import FRESH, name_of
from haptic_device.recording.bag_contents import Joints, Recording, Records
from haptic_device.status import number
from haptic_device.withheld_time import LASTS, WithheldTime

GOALS = ("insertion_fraction", "arrived")  # measures that say of themselves whether the job was done
REACHED = 0.95  # of a goal
_MICRO, _MILLI = 1e6, 1e3


def engaged_rows(trace: Records) -> Records:
    """Rows of the trace with the motor engaged. Raises ValueError if there are fewer than two.

    Args:
        trace: a structured array, one row for each tick.

    Examples:
        >>> from haptic_device.analysis.report.summary import engaged_rows
        >>> from haptic_device.recording import load
        >>> len(engaged_rows(load("run/bag").trace))
        7999
    """
    rows = trace[trace["engage"] > 0]
    if len(rows) < 2:
        raise ValueError(f"the trace of {len(trace)} ticks has {len(rows)} with the motor engaged; two are needed")
    return rows


def first_command(trace: Records) -> float:
    """CLOCK_MONOTONIC [s] of the first tick with the motor engaged. Raises ValueError if there is none."""
    return float(engaged_rows(trace)["deadline"][0]) * 1e-9


def period(rows: Records) -> float:
    """Servo period T [s], the median step of the deadlines."""
    steps = np.diff(rows["deadline"])
    known = steps[np.isfinite(steps)]
    return float(np.median(known)) * 1e-9 if len(known) else np.nan


def servo_figures(rows: Records) -> dict[str, Any]:
    """Figures of the servo: rate [Hz], ticks, missed ticks, quantiles of lateness and of computing time [µs].

    A figure is None if its data is not in the rows.

    Args:
        rows: from `engaged_rows`.

    Examples:
        >>> from haptic_device.analysis.report.summary import engaged_rows, servo_figures
        >>> from haptic_device.recording import load
        >>> figures = servo_figures(engaged_rows(load("run/bag").trace))
        >>> figures["rate_hz"], figures["missed"]
        (4000.0, 0)
    """
    compute = rows["compute"][1:] * _MICRO  # each row carries the time of the tick before it
    steps = _grown(rows["tick"])
    return {
        "rate_hz": 1.0 / period(rows),
        "ticks": None if steps is None else steps + 1,
        "missed": _grown(rows["missed"]),
        "lateness_us": _quantiles(rows["lateness"] * _MICRO, p50=50, p99=99, p999=99.9, max=100),
        "compute_us": _quantiles(compute, p50=50, p99=99, max=100),
    }


def exchange_figures(recording: Recording, rows: Records) -> dict[str, Any]:
    """Figures of the exchange while engaged: samples sent and answered, rate [Hz], age of the tool sample [ms].

    Args:
        recording: the recording, from `load`.
        rows: from `engaged_rows`.

    Examples:
        >>> from haptic_device.analysis.report.summary import engaged_rows, exchange_figures
        >>> from haptic_device.recording import load
        >>> recording = load("run/bag")
        >>> figures = exchange_figures(recording, engaged_rows(recording.trace))
        >>> figures["sent"], figures["answered"]
        (1999, 1999)
    """
    sequence = rows["handle_sequence"][rows["handle_sequence"] > 0]
    sent = np.arange(sequence[0], sequence[-1] + 1) if len(sequence) else sequence
    span = (rows["deadline"][-1] - rows["deadline"][0]) * 1e-9
    age = rows["tool_age"][rows["tool_age"] >= 0] * _MILLI
    return {
        "rate_hz": len(sent) / float(span),
        "sent": len(sent),
        "answered": int(np.isin(sent, _answers(recording, rows)).sum()),
        "age_ms": _quantiles(age, p50=50, p99=99, max=100),
    }


def energy_figures(recording: Recording, rows: Records) -> dict[str, Any]:
    """Energy [J] truly given to the operator by a simulated device, and energy supplied to the tool.

    Energy from the display to the hand, and from the coupling to the tool, is positive. It counts from the first
    message of the recording. None if it was not recorded: a real device cannot measure it.

    Args:
        recording: the recording, from `load`.
        rows: from `engaged_rows`.

    Examples:
        >>> from haptic_device.analysis.report.summary import energy_figures, engaged_rows
        >>> from haptic_device.recording import load
        >>> recording = load("run/bag")
        >>> figures = energy_figures(recording, engaged_rows(recording.trace))
        >>> figures["given_to_operator_end"] < 0.0  # the hand has put energy in
        True
    """
    state = recording.joints.get("operator/state")  # of a simulated device only
    given = [] if state is None else state.entry("energy_given")[state.entry("time") * 1e9 <= rows["deadline"][-1]]
    return {
        "given_to_operator_max": float(np.max(given) - given[0]) if len(given) else None,
        "given_to_operator_end": float(given[-1] - given[0]) if len(given) else None,
        "tool_port_end": energy_given_to_tool(recording),
    }


def energy_given_to_tool(recording: Recording) -> float | None:
    """Energy [J] that the simulation counts at the tool's port from its first status to its last; None if unsaid."""
    return recording.grown("haptic_simulation", "tool_port_energy", "sub_steps")


def waited_time(recording: Recording) -> float | None:
    """Time [s] between handle samples that the world left out; None where the simulation has not said it twice."""
    return recording.grown("haptic_simulation", "waited_s")


def short_time(recording: Recording) -> float:
    """Time [s] in which the tool's port withheld force, where it is worth a word; 0 where the simulation does not say.

    Args:
        recording: the recording, from `load`.

    Examples:
        >>> from haptic_device.analysis.report.summary import short_time
        >>> from haptic_device.recording import load
        >>> short_time(load("run/bag"))
        0.0
    """
    found = recording.grown("haptic_simulation", "short_s") or 0.0
    return found if found > LASTS else 0.0


def contact_figures(recording: Recording, rows: Records | None) -> dict[str, float | None]:
    """The simulation's strongest contact [N] and deepest overlap [m], and the strongest force on the hand in x, y [N].

    A figure is None if its data is not in the recording.

    Args:
        recording: the recording, from `load`.
        rows: from `engaged_rows`, or None.

    Examples:
        >>> from haptic_device.analysis.report.summary import contact_figures, engaged_rows
        >>> from haptic_device.recording import load
        >>> recording = load("run/bag")
        >>> figures = contact_figures(recording, engaged_rows(recording.trace))
        >>> print(f"{figures['max_on_hand_n']:.2f} N")
        1.68 N
    """
    force = np.nan if rows is None else float(np.fmax.reduce(np.hypot(*rows["force_on_handle"][:, :2].T)))
    return {
        "max_force_n": greatest(recording, "max_contact_force")[0],
        "max_penetration_m": greatest(recording, "max_penetration")[0],
        "max_on_hand_n": None if np.isnan(force) else force,
    }


def greatest(recording: Recording, name: str) -> tuple[float | None, float | None]:
    """(value, bound) of a figure of which the simulation keeps the greatest since its world's start.

    The value is None where an earlier one, the bound, hides what this recording came to; both, where nobody said it.
    """
    said = [number(status.values.get(name, "")) for status in recording.statuses("haptic_simulation")]
    known = [value for value in said if np.isfinite(value)]
    if not known:
        return None, None
    found = max((after for before, after in pairwise(known) if after != before), default=0.0)
    hidden = found < known[0] and _touched(recording)
    return (None, known[0]) if hidden else (found, found)


def _touched(recording: Recording) -> bool:
    """Whether the tool may have touched something: the recording says so, or nothing of it."""
    tool = recording.joints.get("tool")
    if "trace" in recording.clouds and "tool_contact" in (recording.trace.dtype.names or ()):
        told = recording.trace["tool_contact"]
    elif tool is not None and "contact" in tool.names:
        told = tool.entry("contact")
    else:
        return True
    return not np.isfinite(told).all() or bool(np.any(told > 0.0))


def results(values: dict[str, str]) -> dict[str, float]:
    """{measure: fraction} of what the scene measures, in the values of a status of the simulation."""
    said = {key.removeprefix("result."): number(value) for key, value in values.items() if key.startswith("result.")}
    return {key: value for key, value in said.items() if not np.isnan(value)}


def greatest_results(recording: Recording) -> dict[str, float]:
    """The greatest value of each result over the run: of every state that the simulation has shown, and its status."""
    found = [results(status.values) for status in recording.statuses("haptic_simulation")]
    if state := recording.joints.get("scene/state"):
        shown = {name.removeprefix("result."): name for name in state.names if name.startswith("result.")}
        values = {short: state.entry(name) for short, name in shown.items()}
        found += [{short: float(np.nanmax(column)) for short, column in values.items() if not np.isnan(column).all()}]
    return {name: max(said[name] for said in found if name in said) for name in dict.fromkeys(chain(*found))}


def late_samples(rows: Records) -> int | None:
    """Ticks whose device sample was of an earlier deadline; None where the trace does not say it."""
    if "device_status" not in (rows.dtype.names or ()) or not np.isfinite(rows["device_status"]).all():
        return None
    return int(np.sum(rows["device_status"].astype(np.int64) & FRESH == 0))


def withheld_figures(recording: Recording) -> dict[str, tuple[float, float]] | None:
    """Time for which force was withheld, {cause: (in all [s], longest [s])}; None if the trace has no such column.

    Args:
        recording: the recording, from `load`.

    Examples:
        >>> from haptic_device.analysis.report.summary import withheld_figures
        >>> from haptic_device.recording import load
        >>> withheld_figures(load("run/bag"))
        {}
    """
    trace = recording.trace
    if "withheld" not in (trace.dtype.names or ()) or np.isnan(trace["withheld"]).all():
        return None
    kept = WithheldTime()
    kept.add(trace["deadline"], trace["withheld"])
    return kept.totals()


def residual_figures(recording: Recording, rows: Records) -> dict[str, Any]:
    """How far the coupling's forces on handle and tool are from equal and opposite [N], RMS over x and y.

    The tool's force belongs to an older handle sample. `explained_by_age_n` is the difference that this age explains: K
    Δstretch + B Δrate, where Δ is the value in the servo less that of the sample. `unexplained_n` is the RMS of the
    rest. All are None if no tool sample answers a recorded handle sample.

    Args:
        recording: the recording, from `load`.
        rows: from `engaged_rows`.

    Examples:
        >>> from haptic_device.analysis.report.summary import engaged_rows, residual_figures
        >>> from haptic_device.recording import load
        >>> recording = load("run/bag")
        >>> residual_figures(recording, engaged_rows(recording.trace))  # a lock-step bag has no handle samples
        {'rms_n': None, 'explained_by_age_n': None, 'unexplained_n': None}
    """
    handle = recording.joint("handle")
    rows = rows[(rows["tool_age"] >= 0) & (rows["engage"] >= 1) & (rows["exchange_fade"] >= 1)]
    rows, answered = _with_answered(rows, handle)
    if len(rows) == 0:
        return dict.fromkeys(("rms_n", "explained_by_age_n", "unexplained_n"))
    gain = gains(recording)
    stretch = rows["coupling_position"] - rows["position"] - rows["tool_position"]
    rate = rows["coupling_velocity"] - rows["velocity"] - rows["tool_velocity"]
    explained = gain["stiffness"] * (_plane(stretch) + _plane(handle.position, handle)[answered])
    explained += gain["damping"] * (_plane(rate) + _plane(handle.velocity, handle)[answered])
    residual = _plane(rows["force_coupling"] + rows["tool_effort"])
    return {"rms_n": _rms(residual), "explained_by_age_n": _rms(explained), "unexplained_n": _rms(residual - explained)}


def gains(recording: Recording) -> dict[str, float]:
    """Coupling gains last sent with the handle: stiffness [N/m], damping [N s/m] and their rotational fellows."""
    handle = recording.joint("handle")
    names = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
    return {name: float(handle.entry(name)[-1]) for name in names}


def faults(recording: Recording) -> list[str]:
    """Names of the faults that latched, each once, in the order of their codes."""
    return [name_of(code) for code in np.unique(np.nan_to_num(recording.trace["fault"])) if code]


def conditions(recording: Recording) -> dict[str, str]:
    """What every figure is labelled with: gains, period, physical damping, exchange method."""
    gain = gains(recording)
    units = {"stiffness": ("K", "N/m"), "damping": ("B", "N s/m")}
    units |= {"rotational_stiffness": ("Kθ", "N m/rad"), "rotational_damping": ("Bθ", "N m s/rad")}
    labels = {symbol: f"{gain[name]:g} {unit}" for name, (symbol, unit) in units.items()}
    said = recording.last_values("haptic_driver")
    if "trace" in recording.clouds:
        labels["T"] = f"{period(recording.trace) * 1e6:.0f} µs"
    elif (rate := number(said.get("rate_hz", ""))) > 0.0:
        labels["T"] = f"{1e6 / rate:.0f} µs"
    if damping := said.get("physical_damping"):
        labels["b"] = _with_units(damping.split(", "))
    number_of_method = int(recording.joint("handle").entry("exchange_method")[-1])
    return labels | {"exchange": exchange_samples.name_of(number_of_method)}


def _with_units(damping: list[str]) -> str:
    """Physical damping of the axes x, y, θ, as far as the device has them."""
    angle = f", {damping[2]} N m s/rad" if len(damping) > 2 else ""
    return ", ".join(damping[:2]) + " N s/m" + angle


def _answers(recording: Recording, rows: Records) -> Array:
    """Sequences answered: by the recorded tool messages, and by those the servo used and the recorder may have lost."""
    tool = recording.joints.get("tool")
    recorded = tool.entry("answered") if tool else np.empty(0)
    used = rows["tool_answered"]
    fresh = np.append(True, used[1:] != used[:-1])  # each is used for some ticks, and a long bag has millions
    return np.union1d(recorded, used[fresh])


def _with_answered(rows: Records, handle: Joints) -> tuple[Records, npt.NDArray[np.intp]]:
    """Rows whose tool sample answers a recorded handle sample of the last session, and the index of that sample."""
    session = handle.entry("session")
    last = np.flatnonzero(session == session[-1])
    sequence = handle.entry("sequence")[last]
    place = np.minimum(np.searchsorted(sequence, rows["tool_answered"]), len(last) - 1)
    known = sequence[place] == rows["tool_answered"]
    return rows[known], last[place[known]]


def _plane(columns: Array, topic: Joints | None = None) -> Array:
    """The columns of x and y; of a topic only those axes that it has, the rest zero."""
    plane = np.zeros((len(columns), 2))
    for axis, name in enumerate(("x", "y")):
        if topic is None or name in topic.names:
            plane[:, axis] = columns[:, axis]
    return plane


def _grown(count: Array) -> int | None:
    """Last less first of the values that are numbers; None if there is none."""
    known = count[np.isfinite(count)]
    return int(known[-1] - known[0]) if len(known) else None


def _rms(vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def _quantiles(values: Array, **wanted: float) -> dict[str, float | None]:
    """Of the values that are numbers."""
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return dict.fromkeys(wanted)
    return dict(zip(wanted, map(float, np.percentile(values, list(wanted.values()))), strict=True))
