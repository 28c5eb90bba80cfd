# SPDX-License-Identifier: Apache-2.0
"""How each figure of a run is computed. None is what the run does not tell.

The figures are of `run.rows`, the ticks with the motor engaged.
"""

from collections.abc import Callable
from itertools import chain, pairwise

import numpy as np
import numpy.typing as npt

from haptic_device.control.exchange_samples import METHODS
from haptic_device.control.faults import FRESH, name_of
from haptic_device.control.withheld import LASTS, WithheldTime
from haptic_device.recording.bag_contents import Joints, Recording, Records
from haptic_device.recording.status import number
from haptic_device.theory.quantity import Array
from haptic_display.run.report.conditions import GAINS, gains, period
from haptic_display.run.report.run import Run

GOALS = ("insertion_fraction", "arrived")  # measures that say of themselves whether the job was done
REACHED = 0.95  # of a goal
PORT = "tool_port"  # which withholds force too
_MICRO, _MILLI = 1e6, 1e3


def engaged_rows(trace: Records) -> Records:
    """Rows of the trace with the motor engaged. Raises ValueError if there are fewer than two.

    Args:
        trace: a structured array, one row for each tick.

    Examples:
        >>> from haptic_display.run.report.summary import engaged_rows
        >>> from haptic_device.recording import load
        >>> len(engaged_rows(load("run/bag").trace))
        7999
    """
    if said := hardly_engaged(trace):
        raise ValueError(said)
    return trace[trace["engage"] > 0]


def hardly_engaged(trace: Records) -> str:
    """That fewer than two ticks of the trace have the motor engaged; "" if two have."""
    count = int(np.sum(trace["engage"] > 0))
    return "" if count > 1 else f"the trace of {len(trace)} ticks has {count} with the motor engaged; two are needed"


def startup(run: Run) -> float | None:
    """From the start of the command to the first tick [s]."""
    return None if run.started is None else float(run.rows["deadline"][0]) * 1e-9 - run.started


def servo_rate(run: Run) -> float:
    """[Hz]"""
    step = period(run.rows)
    return 1.0 / step if step else np.nan


def ticks(run: Run) -> int | None:
    """Periods from the first tick to the last, those that were missed among them."""
    steps = _grown(run.rows["tick"])
    return None if steps is None else steps + 1


def missed(run: Run) -> int | None:
    """Ticks that were missed."""
    return _grown(run.rows["missed"])


def lateness(run: Run) -> dict[str, float | None]:
    """How late the servo woke [µs]."""
    return _quantiles(run.rows["lateness"] * _MICRO, p50=50, p99=99, p999=99.9, max=100)


def compute(run: Run) -> dict[str, float | None]:
    """What a tick took [µs]; each row carries the time of the tick before it."""
    return _quantiles(run.rows["compute"][1:] * _MICRO, p50=50, p99=99, max=100)


def realtime(run: Run) -> str | None:
    """What the driver says of its scheduling."""
    return run.recording.last_values("haptic_driver").get("realtime")


def said_by_simulation(name: str) -> Callable[[Run], str | None]:
    """An entry of its last status."""
    return lambda run: run.recording.last_values("haptic_simulation").get(name)


def sent(run: Run) -> int:
    """Handle samples sent."""
    return len(_sent(run.rows))


def exchange_rate(run: Run) -> float:
    """Handle samples sent a second [Hz]."""
    span = float((run.rows["deadline"][-1] - run.rows["deadline"][0]) * 1e-9)
    return sent(run) / span if span else np.nan


def answered(run: Run) -> int:
    """Handle samples sent that were answered."""
    return int(np.isin(_sent(run.rows), _answers(run.recording, run.rows)).sum())


def age(run: Run) -> dict[str, float | None]:
    """Age of the tool sample in use [ms]."""
    found = run.rows["tool_age"]
    return _quantiles(found[found >= 0] * _MILLI, p50=50, p99=99, max=100)


def energy_to_operator(recording: Recording, rows: Records) -> Array:
    """Energy [J] truly given to the operator since the first message, until the last of these ticks; empty if unsaid.

    Energy from the display to the hand is positive. A real device cannot measure it.
    """
    if recording.lacks("operator/state", "energy_given", "time"):
        return np.empty(0)
    state = recording.joints["operator/state"]
    given = state.entry("energy_given")[state.entry("time") * 1e9 <= rows["deadline"][-1]]
    return given - given[:1]


def most_given(run: Run) -> float | None:
    """The largest energy given to the operator [J]."""
    given = energy_to_operator(run.recording, run.rows)
    return float(np.max(given)) if len(given) else None


def given_at_end(run: Run) -> float | None:
    """Energy given to the operator at the end [J]."""
    given = energy_to_operator(run.recording, run.rows)
    return float(given[-1]) if len(given) else None


def given_to_tool(run: Run) -> float | None:
    """Energy [J] that the simulation counts at the tool's port from its first status to its last; None if unsaid."""
    return run.recording.grown("haptic_simulation", "tool_port_energy", "sub_steps")


def waited(run: Run) -> float | None:
    """Time [s] between handle samples that the world left out; None where the simulation has not said it twice."""
    return run.recording.grown("haptic_simulation", "waited_s")


def withheld_by_port(run: Run) -> float:
    """Time [s] in which the tool's port withheld force, where it is worth a word; 0 where nobody says it."""
    found = run.recording.grown("haptic_simulation", "short_s") or 0.0
    return found if found > LASTS else 0.0


def apart(run: Run) -> tuple[float, float]:
    """RMS and largest distance from handle to tool [m]."""
    distance = run.distance[np.isfinite(run.distance)]
    if not len(distance):
        return np.nan, np.nan
    return float(np.sqrt(np.mean(distance**2, dtype=float))), float(np.max(distance))


def on_hand(run: Run) -> float | None:
    """The strongest force on the hand in x, y [N]."""
    if not run.traced:
        return None
    force = float(np.fmax.reduce(np.hypot(*run.rows["force_on_handle"][:, :2].T)))
    return None if np.isnan(force) else force


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


def _greatest_of(name: str) -> Callable[[Run], float | None]:
    return lambda run: greatest(run.recording, name)[0]


strongest, deepest = _greatest_of("max_contact_force"), _greatest_of("max_penetration")  # contact [N], overlap [m]


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


def last_results(run: Run) -> dict[str, float]:
    """{measure: fraction} of what the scene measures, at the end."""
    return _results(run.recording.last_values("haptic_simulation"))


def _results(values: dict[str, str]) -> dict[str, float]:
    said = {key.removeprefix("result."): number(value) for key, value in values.items() if key.startswith("result.")}
    return {key: value for key, value in said.items() if not np.isnan(value)}


def greatest_results(run: Run) -> dict[str, float]:
    """The greatest value of each result over the run: of every state that the simulation has shown, and its status."""
    found = [_results(status.values) for status in run.recording.statuses("haptic_simulation")]
    if state := run.recording.joints.get("scene/state"):
        shown = {name.removeprefix("result."): name for name in state.names if name.startswith("result.")}
        values = {short: state.entry(name) for short, name in shown.items()}
        found += [{short: float(np.nanmax(column)) for short, column in values.items() if not np.isnan(column).all()}]
    return {name: max(said[name] for said in found if name in said) for name in dict.fromkeys(chain(*found))}


def late_samples(run: Run) -> int | None:
    """Ticks whose device sample was of an earlier deadline; None where the trace does not say it."""
    rows = run.rows
    if "device_status" not in (rows.dtype.names or ()) or not np.isfinite(rows["device_status"]).all():
        return None
    return int(np.sum(rows["device_status"].astype(np.int64) & FRESH == 0))


def withheld(run: Run) -> dict[str, tuple[float, float]] | None:
    """Time for which force was withheld, {cause: (in all [s], longest [s])}; None if the trace has no such column."""
    trace = run.recording.trace
    if "withheld" not in (trace.dtype.names or ()) or np.isnan(trace["withheld"]).all():
        return None
    kept = WithheldTime()
    kept.add(trace["deadline"], trace["withheld"])
    return kept.totals()


def withheld_seconds(run: Run) -> dict[str, float]:
    """How long each cause withheld force [s], on the device's side and at the tool's port."""
    causes = withheld(run) if run.traced else None
    found = {name: total for name, (total, _) in (causes or {}).items()}
    return found | ({PORT: short} if (short := withheld_by_port(run)) else {})


def no_residual(run: Run) -> str:
    """Why a run has no `residual`; "" where it has."""
    needed = "session", "sequence", *GAINS
    if reason := run.no_trace or hardly_engaged(run.recording.trace) or run.recording.lacks("handle", *needed):
        return reason
    if run.recording.lacks("handle", "exchange_method"):
        return ""
    numbers = run.recording.joint("handle").entry("exchange_method")
    known = np.isin(numbers[np.isfinite(numbers)], [*METHODS.values()])
    return "" if known.all() else "it was recorded with an exchange method that this version lacks"


def residual(run: Run) -> dict[str, float | None]:
    """How far the coupling's forces on handle and tool are from equal and opposite [N], RMS over x and y.

    The tool's force belongs to an older handle sample. `explained_by_age_n` is the difference that this age explains: K
    Δstretch + B Δrate, where Δ is the value in the servo less that of the sample. `unexplained_n` is the RMS of the
    rest. All are None if no tool sample answers a recorded handle sample.
    """
    handle, gain = run.recording.joint("handle"), gains(run.recording)
    rows = engaged_rows(run.recording.trace)
    rows = rows[(rows["tool_age"] >= 0) & (rows["engage"] >= 1) & (rows["exchange_fade"] >= 1)]
    rows, answered = _with_answered(rows, handle)
    if len(rows) == 0:
        return dict.fromkeys(("rms_n", "explained_by_age_n", "unexplained_n"))
    stretch = rows["coupling_position"] - rows["position"] - rows["tool_position"]
    rate = rows["coupling_velocity"] - rows["velocity"] - rows["tool_velocity"]
    explained = gain["stiffness"] * (_plane(stretch) + _plane(handle.position, handle)[answered])
    explained += gain["damping"] * (_plane(rate) + _plane(handle.velocity, handle)[answered])
    found = _plane(rows["force_coupling"] + rows["tool_effort"])
    return {"rms_n": _rms(found), "explained_by_age_n": _rms(explained), "unexplained_n": _rms(found - explained)}


def faults(run: Run) -> list[str]:
    """Names of the faults that latched, each once, in the order of their codes."""
    return [name_of(code) for code in np.unique(np.nan_to_num(run.recording.trace["fault"])) if code]


def _sent(rows: Records) -> Array:
    """Sequences of the handle samples sent."""
    sequence = rows["handle_sequence"][rows["handle_sequence"] > 0]
    return np.arange(sequence[0], sequence[-1] + 1) if len(sequence) else sequence


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
