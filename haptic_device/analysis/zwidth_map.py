# SPDX-License-Identifier: Apache-2.0
"""A map of the K–B plane: rows of cells over all cores, with a file from which an interrupted map goes on."""

import contextlib
import json
import os
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from haptic_device.analysis.quantity import finite, not_negative
from haptic_device.analysis.sweep import spread
from haptic_device.analysis.zwidth import SHAKING, Outcome, Setup, check_setup, operators_of, run_cells, theory

SAVE_EVERY = 16  # rows between two writes of the resume file


class Request(NamedTuple):
    """What a map is of: device, operator's name, and the axes of the plane, K [N/m] and B [N s/m]."""

    setup: Setup
    operator: str
    stiffness: np.ndarray
    damping: np.ndarray

    def text(self) -> str:
        """All of it as one text, to tell whether a resume file is of this map."""
        axes = [list(map(float, axis)) for axis in (self.stiffness, self.damping)]
        return json.dumps([self.setup._asdict(), self.operator, *axes])


class Plane(NamedTuple):
    """Outcomes over (B, K), and which rows (of one B each) are done."""

    outcome: Outcome
    done: np.ndarray


def draw_map(
    request: Request,
    workers: int,
    resume: Path | None = None,
    progress: Callable = lambda done: None,
    scheduler: str = "",
) -> Plane:
    """Runs all rows that `resume` does not hold yet; it is written as rows come, and when interrupted.

    By threads, or by the workers of a Dask scheduler (sweep.spread). progress(rows done) is called after each. Raises
    ValueError, one sentence, for values that cannot be, for a resume file that is not this map's, for a scheduler that
    is not there.
    """
    check_setup(request.setup)
    not_negative("stiffness", request.stiffness, "N/m")
    finite("damping", request.damping, "N s/m")
    operators = operators_of(request.operator)
    plane = _read(resume, request) if resume is not None and resume.exists() else _empty(request)
    todo = np.flatnonzero(~plane.done)
    progress(int(plane.done.sum()))
    rows = {int(i): (request.setup, operators, request.stiffness, request.damping[i]) for i in todo}
    with (
        _saving(resume, request, plane) as save,
        contextlib.closing(spread(run_cells, rows, workers, scheduler)) as results,
    ):
        for row, outcome in results:
            _keep(plane, row, outcome)
            progress(int(plane.done.sum()))
            save(int(plane.done.sum()))
    return plane


def boundaries(request: Request, plane: Plane, lateness: float = 0.0) -> dict[str, np.ndarray]:
    """K [N/m] over B up to which all cells are `quiet`, and none shakes (`not shaking`), and the largest K of theory.

    One cell that is otherwise hides all above it, which may be quiet again: the map shows them."""
    verdict = plane.outcome.verdict
    return {
        "quiet": _first(request.stiffness, verdict > 0),
        "not shaking": _first(request.stiffness, verdict == SHAKING),
        **theory(request.setup, request.damping, lateness),
    }


def write_csv(path: Path, request: Request, plane: Plane) -> None:
    """One line a cell: B, K, verdict (0 quiet, 1 gives energy, 2 shakes), energy given, growth."""
    damping, stiffness = np.meshgrid(request.damping, request.stiffness, indexing="ij")
    columns = [column.ravel() for column in (damping, stiffness, *plane.outcome)]
    head = "damping_ns_per_m,stiffness_n_per_m,verdict,energy_given_j,growth"
    np.savetxt(path, np.column_stack(columns), "%.10g", ",", header=head, comments="")


def _first(stiffness, bad):
    """The last K before the first bad one of each row; the largest K of the map where none is bad, 0 where all are."""
    before = np.concatenate([[0.0], stiffness])
    return before[np.where(bad.any(axis=1), bad.argmax(axis=1), stiffness.size)]


def _empty(request):
    shape = (request.damping.size, request.stiffness.size)
    return Plane(Outcome(np.zeros(shape, np.int8), np.zeros(shape), np.zeros(shape)), np.zeros(shape[0], bool))


def _keep(plane, row, outcome):
    for kept, column in zip(plane.outcome, outcome, strict=True):
        kept[row] = column
    plane.done[row] = True


@contextlib.contextmanager
def _saving(path, request, plane):
    """Yields save(rows done); writes the file for the last time whatever ends the block."""

    def save(rows):
        if path is not None and rows % SAVE_EVERY == 0:
            _write(path, request, plane)

    if path is not None:
        _write(path, request, plane)
    try:
        yield save
    finally:
        if path is not None:
            _write(path, request, plane)


def _write(path, request, plane):
    """Beside it first, so that no half file is ever under its name."""
    beside = path.with_name(path.name + ".part")
    with open(beside, "wb") as file:
        np.savez_compressed(file, request=np.array(request.text()), done=plane.done, **plane.outcome._asdict())
    os.replace(beside, path)


def _read(path, request):
    try:
        with np.load(path, allow_pickle=False) as kept:
            known, plane = str(kept["request"]), Plane(Outcome(*(kept[n] for n in Outcome._fields)), kept["done"])
    except (OSError, ValueError, TypeError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        reason = getattr(error, "strerror", None) or "it holds no map"
        raise ValueError(f"resume file {path} cannot be read ({reason}); delete it or name another") from None
    if known != request.text() or plane.outcome.verdict.shape != (request.damping.size, request.stiffness.size):
        raise ValueError(f"resume file {path} is of another map; delete it or name another")
    return plane
