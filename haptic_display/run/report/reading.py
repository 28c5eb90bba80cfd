# SPDX-License-Identifier: Apache-2.0
"""Reads a bag for a report: only the columns that it shows, and the other topics where there is no trace."""

from pathlib import Path

import numpy as np

from haptic_device.recording.bag_contents import Joints
from haptic_device.recording.bag_topics import TOPICS, load
from haptic_device.recording.columns import Entries
from haptic_display.run.report.run import AXES, WRENCH, Run

TRACE = np.dtype(  # a tick in a quarter of its full size: ten minutes at 4 kHz then fit into half a gigabyte
    [(name, "f8") for name in ("tick", "deadline", "tool_answered", "handle_sequence", "missed")]
    + [(name, "f4", (3,)) for name in ("position", "velocity", "tool_position", "tool_velocity", "tool_effort")]
    + [("exchange_fade", "f4"), ("coupling_position", "f4", (3,)), ("coupling_velocity", "f4", (3,))]
    + [(name, "f4") for name in ("lateness", "compute", "tool_age", "tool_contact", "engage", "fault", "withheld")]
    + [(name, "f4") for name in ("device_status", "stamp_error")]
    + [("exchange_shortened", "f8")]  # f4 counts to 2**24 only: four hours at 1 kHz
    + [(name, "f4", (3,)) for name in ("force_coupling", "force_on_handle", "force_walls", "energy_given", "margin")]
)
HANDLE = ("exchange_method", "stiffness", "damping", "rotational_stiffness", "rotational_damping")
ONLY = {
    "trace": TRACE,
    "handle": Entries((*AXES, *HANDLE, "session", "sequence"), ("position", "velocity")),
    "tool": Entries(("answered",), ("position",)),
    "operator/state": Entries((*AXES, *(f"motor_{name}" for name in AXES), "energy_given", "time")),
}
NO_TRACE = {  # where the trace cannot be had: every topic, and what of it stands for the trace's columns
    **{name: Entries((), ()) for name in TOPICS if name != "trace"},
    "handle": Entries((*HANDLE, *AXES), ("position", "effort")),
    "tool": Entries((*AXES, "contact"), ("position", "effort")),
    "motor": Entries(AXES, ("effort",)),
    "wrench": Entries(WRENCH, ("effort",)),
    "operator/state": ONLY["operator/state"],
}
LEFT_OUT = (
    "servo, exchange, passivity margin, impedance and spectrum are left out; positions, forces and contacts are those "
    "of the topics, and time counts from the first message"
)


def read_run(bag: Path | str, namespace: str | None = None) -> Run:
    """Reads the run in a bag, with the columns that a report shows.

    If a bag has no trace, the other topics are read. Raises FileNotFoundError or ValueError with one sentence if there
    is nothing to show.

    Args:
        bag: path of the bag.
        namespace: needed only if the bag has several devices.

    Examples:
        >>> from haptic_display.run.report.reading import read_run
        >>> run = read_run("run/bag")
        >>> run.scene, run.traced, f"{run.length:.2f} s"
        ('wall', True, '2.00 s')
    """
    recording = load(bag, namespace, ONLY)
    run = Run(recording, _name(Path(bag)), list(recording.notes))
    try:
        missing = recording.trace_rows_missing if len(run.rows) else 0
    except ValueError as error:
        return _without_trace(run, error)
    if missing:
        run.notes.append(f"{missing} ticks are missing from the trace")
    return run


def _without_trace(run: Run, error: ValueError) -> Run:
    """The run as the other topics tell it. Raises the error, which the trace made, if none of them can be read."""
    recording = load(run.recording.bag, run.recording.namespace, NO_TRACE)
    ours = any(name.startswith(f"{recording.namespace}/") for name in recording.counts)
    if not ours or not (recording.joints or recording.marks or recording.diagnostics):
        raise error
    reason = str(error) if "trace" in run.recording.clouds else "there is no trace"
    notes = dict.fromkeys([f"{reason}: {LEFT_OUT}", *run.notes, *recording.notes])
    return Run(recording, run.name, [*notes, *_no_numbers_in(recording.joints)], reason)


def _no_numbers_in(topics: dict[str, Joints]) -> list[str]:
    """A sentence for each topic with values that are no numbers."""
    wrong = {name: int(np.isnan(np.hstack(joints[-3:])).any(axis=1).sum()) for name, joints in topics.items()}
    said = "messages have values that are no numbers"
    return [f"topic {name}: {count} of {len(topics[name].stamp)} {said}" for name, count in wrong.items() if count]


def _name(bag: Path) -> str:
    bag = bag.absolute()
    return bag.parent.name if bag.name == "bag" else bag.name
