# SPDX-License-Identifier: Apache-2.0
"""A recorded servo computed again from its trace, and compared to the bit."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from haptic_device.law import servo
from haptic_device.runtime import recompute

BLOCK = 100_000  # ticks computed at a time


class Verdict(NamedTuple):
    """Ticks computed again, ticks that could not be (no snapshot before them), ticks that differ, and in what."""

    same: int
    skipped: int
    different: int
    first: int | None
    columns: tuple[str, ...]


def verdict_on(trace: np.ndarray, snapshots: np.ndarray) -> Verdict:
    """Computes every tick of the trace again that follows a snapshot without a gap, or begins at tick 0.

    Raises ValueError if trace or snapshots are of another version of the servo, or there is no snapshot at all.
    """
    _check(trace, snapshots)
    same, done, first, columns, different = 0, 0, None, set(), 0
    for begin, end, settings, memory in _stretches(trace, snapshots):
        for at in range(begin, end, BLOCK):
            recorded = trace[at : min(end, at + BLOCK)]
            again = recorded.copy()
            recompute.recompute(settings, memory, again)
            wrong = _differences(recorded, again)
            done += len(recorded)
            same += len(recorded) - int(wrong.sum())
            different += int(wrong.sum())
            if wrong.any():
                first = int(recorded["tick"][np.argmax(wrong)]) if first is None else first
                columns |= _names(recorded[wrong], again[wrong])
    return Verdict(same, len(trace) - done, different, first, tuple(sorted(columns)))


def _check(trace, snapshots):
    if trace.dtype.names != servo.TICK.names or trace.dtype.itemsize != servo.TICK.itemsize:
        strange = sorted(set(trace.dtype.names) ^ set(servo.TICK.names)) or ["another order"]
        raise ValueError(f"the trace is of another version of the servo; it differs in {', '.join(strange)}")
    if len(snapshots) == 0:
        raise ValueError("the bag has no snapshot of the servo's settings, without which no tick can be computed again")
    recompute.parts_of(snapshots[:1])


def _stretches(trace, snapshots) -> Iterator[tuple]:
    """(begin, end, settings, memory) of rows that can be computed one after the other."""
    ticks = trace["tick"].astype(np.int64)
    breaks = np.flatnonzero(np.diff(ticks) != 1) + 1
    after = {int(snapshot["tick"]) + 1: snapshot for snapshot in snapshots}
    settings = {int(snapshot["settings.version"]): snapshot for snapshot in snapshots}
    for begin, end in zip([0, *breaks], [*breaks, len(trace)], strict=True):
        yield from _stretch(trace, int(begin), int(end), after, settings)


def _stretch(trace, begin, end, after, settings):
    """The same of one stretch without a gap; memory goes on from one set of settings to the next."""
    memory, at = None, begin
    while at < end:
        tick, version = int(trace["tick"][at]), int(trace["parameter_version"][at])
        if memory is None and tick == 0:
            memory = np.zeros(1, servo.MEMORY)
        elif memory is None and tick in after:
            memory = recompute.parts_of(after[tick])[1]
        if memory is None or version not in settings:
            at = min((begin + t - int(trace["tick"][begin]) for t in after if t > tick), default=end)
            memory = None
            continue
        changes = np.flatnonzero(trace["parameter_version"][at:end] != version)
        until = at + int(changes[0]) if len(changes) else end
        yield at, until, recompute.parts_of(settings[version])[0], memory
        at = until


def _differences(recorded, again):
    return (_bits(recorded) != _bits(again)).any(axis=1)


def _bits(rows):
    return np.ascontiguousarray(rows).view(np.int64).reshape(len(rows), -1)


def _names(recorded, again):
    return {name for name in recorded.dtype.names if not np.array_equal(recorded[name], again[name], equal_nan=True)}
