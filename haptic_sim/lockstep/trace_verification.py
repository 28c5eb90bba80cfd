# SPDX-License-Identifier: Apache-2.0
"""A recorded servo computed again from its trace, and compared to the bit."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from haptic_device.control import contact_model, records
from haptic_device.control.exchange_samples import METHODS
from haptic_device.message_fields import COMMON, EACH, MOST
from haptic_device.realtime import tick_replay

BLOCK = 100_000  # ticks computed at a time
ADDED = frozenset({"withheld", "stamp_error", "joint", "torque"})  # columns that older traces lack, where they were 0
COLUMNS = records.TRACE_ROW.names or ()
SECOND = 1_000_000_000
Stretch = tuple[int, int, np.ndarray, np.ndarray]
"""begin, end, settings, memory"""


class Verdict(NamedTuple):
    """Ticks computed again, ticks that could not be (no snapshot before them), ticks that differ, and in what."""

    same: int
    skipped: int
    different: int
    first: int | None
    columns: tuple[str, ...]


def contact_sets(points: np.ndarray | None) -> np.ndarray:
    """SET records of the points of `local_contacts`; none where it was not recorded."""
    if points is None:
        return np.zeros(0, contact_model.SET)
    heads = points.reshape(-1, MOST)
    sets = np.zeros(len(heads), contact_model.SET)
    for name in COMMON:
        sets[name] = heads[name][:, 0]
    sets["number"] = sets["answered"]
    sets["table"] = np.stack([heads[name] for name in EACH], axis=-1)
    return sets[np.argsort(sets["number"], kind="stable")]


def verdict_on(trace: np.ndarray, snapshots: np.ndarray, points: np.ndarray | None = None) -> Verdict:
    """Computes every tick of the trace again that follows a snapshot without a gap, or begins at tick 0.

    points: of `local_contacts`, if they were recorded.

    Raises ValueError if trace or snapshots are of another version of the servo, or there is no snapshot at all.
    """
    trace, lacking = _with_all_columns(trace)
    _check(trace, snapshots)
    sets = contact_sets(points)
    same, done, first, columns, different = 0, 0, None, set(), 0
    for begin, end, settings, memory in _stretches(trace, snapshots):
        for at in range(begin, end, BLOCK):
            recorded = trace[at : min(end, at + BLOCK)]
            again = recorded.copy()
            tick_replay.recompute(settings, memory, again, sets)
            for name in lacking:
                again[name] = recorded[name]
            wrong = _differences(recorded, again)
            done += len(recorded)
            same += len(recorded) - int(wrong.sum())
            different += int(wrong.sum())
            if wrong.any():
                first = int(recorded["tick"][np.argmax(wrong)]) if first is None else first
                columns |= _names(recorded[wrong], again[wrong])
    return Verdict(same, len(trace) - done, different, first, tuple(sorted(columns)))


def _with_all_columns(trace: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The trace with the columns in ADDED that it lacks, as zeros, and their names."""
    there = trace.dtype.names or ()
    lacking = [name for name in COLUMNS if name in ADDED and name not in there]
    known = [name for name in COLUMNS if name not in lacking]
    if not lacking or list(there) != known:
        return trace, []
    whole = np.zeros(len(trace), records.TRACE_ROW)
    for name in known:
        whole[name] = trace[name]
    return whole, lacking


def _check(trace: np.ndarray, snapshots: np.ndarray) -> None:
    if trace.dtype.names != COLUMNS or trace.dtype.itemsize != records.TRACE_ROW.itemsize:
        strange = sorted(set(trace.dtype.names or ()) ^ set(COLUMNS)) or ["another order"]
        raise ValueError(f"the trace is of another version of the servo; it differs in {', '.join(strange)}")
    if len(snapshots) == 0:
        raise ValueError("the bag has no snapshot of the servo's settings, without which no tick can be computed again")
    tick_replay.parts_of(snapshots[:1])
    if unknown := set(snapshots["settings.exchange_method"]) - set(METHODS.values()):
        raise ValueError(f"the bag was recorded with exchange method {unknown.pop():g}, which this version lacks")


def _stretches(trace: np.ndarray, snapshots: np.ndarray) -> Iterator[Stretch]:
    """Rows that can be computed one after the other."""
    breaks = np.flatnonzero(np.diff(trace["tick"]) != 1) + 1
    for begin, end in zip([0, *breaks], [*breaks, len(trace)], strict=True):
        yield from _stretch(trace, int(begin), int(end), snapshots)


def _stretch(trace: np.ndarray, begin: int, end: int, snapshots: np.ndarray) -> Iterator[Stretch]:
    """The same of rows without a gap; memory goes on from one set of settings to the next."""
    memory, at = None, begin
    while at < end:
        memory = _memory_before(trace, at, snapshots) if memory is None else memory
        settings = _settings_of(trace[at], snapshots)
        if memory is None or settings is None:
            memory, at = None, _next_start(trace, at, end, snapshots)
            continue
        changes = np.flatnonzero(trace["parameter_version"][at:end] != trace["parameter_version"][at])
        until = at + int(changes[0]) if len(changes) else end
        yield at, until, settings, memory
        at = until


def _memory_before(trace: np.ndarray, at: int, snapshots: np.ndarray) -> np.ndarray | None:
    """What the servo remembered before row `at`; None if no snapshot says it."""
    if trace["tick"][at] == 0:
        return np.zeros(1, records.STATE)
    elapsed = trace["latched"][at] - snapshots["memory.latched"]  # a restarted servo counts its ticks anew
    found = np.flatnonzero((snapshots["tick"] == trace["tick"][at] - 1) & (elapsed >= 0) & (elapsed < SECOND))
    return tick_replay.parts_of(snapshots[found[:1]])[1] if len(found) else None


def _settings_of(row: np.void, snapshots: np.ndarray) -> np.ndarray | None:
    """Settings of the row's version, as the next snapshot has them, or else the last one; None if there is none."""
    same = snapshots[snapshots["settings.version"] == row["parameter_version"]]
    if len(same) == 0:
        return None
    later = np.flatnonzero(same["memory.latched"] >= row["latched"])
    place = later[0] if len(later) else len(same) - 1
    return tick_replay.parts_of(same[place : place + 1])[0]


def _next_start(trace: np.ndarray, at: int, end: int, snapshots: np.ndarray) -> int:
    """Index of the next row that follows a snapshot."""
    rest = np.isin(trace["tick"][at + 1 : end] - 1, snapshots["tick"])
    return at + 1 + int(np.argmax(rest)) if rest.any() else end


def _differences(recorded: np.ndarray, again: np.ndarray) -> np.ndarray:
    return (_bits(recorded) != _bits(again)).any(axis=1)


def _bits(rows: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(rows).view(np.int64).reshape(len(rows), -1)


def _names(recorded: np.ndarray, again: np.ndarray) -> set[str]:
    return {name for name in COLUMNS if not np.array_equal(recorded[name], again[name], equal_nan=True)}
