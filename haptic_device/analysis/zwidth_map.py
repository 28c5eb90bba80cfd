# SPDX-License-Identifier: Apache-2.0
"""A map of the K–B plane: rows of cells over all cores."""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haptic_device.analysis.quantity import Array, Flags, finite, not_negative
from haptic_device.analysis.sweep import spread
from haptic_device.analysis.zwidth import SHAKING, Outcome, Setup, check_setup, operators_of, run_cells, theory
from haptic_device.os_errors import naming


class Request(NamedTuple):
    """What a map is of: device, operator's name, and the axes of the plane, K [N/m] and B [N s/m]."""

    setup: Setup
    operator: str
    stiffness: Array
    damping: Array


class Plane(NamedTuple):
    """Outcomes over (B, K), and which rows (of one B each) are done."""

    outcome: Outcome
    done: Flags


def empty(request: Request) -> Plane:
    """A plane of which nothing is done."""
    shape = (request.damping.size, request.stiffness.size)
    return Plane(Outcome(np.zeros(shape, np.int8), np.zeros(shape), np.zeros(shape)), np.zeros(shape[0], bool))


def draw_map(
    request: Request,
    workers: int,
    progress: Callable[[int], object] = lambda done: None,
    scheduler: str = "",
    plane: Plane | None = None,
) -> Plane:
    """Runs all rows, into `plane`, an empty one, where it is given: what is done is there if this is interrupted.

    By threads, for the cells run without the interpreter's lock, or by the workers of a Dask scheduler (sweep.spread).
    progress(rows done) is called after each. Raises ValueError, one sentence, for values that cannot be, for a
    scheduler that is not there.
    """
    check_setup(request.setup)
    not_negative("stiffness", request.stiffness, "N/m")
    finite("damping", request.damping, "N s/m")
    operators, plane = operators_of(request.operator), plane or empty(request)
    rows = {row: (request.setup, operators, request.stiffness, damping) for row, damping in enumerate(request.damping)}
    progress(0)
    with contextlib.closing(spread(run_cells, rows, workers, scheduler, threads=True)) as results:
        for row, outcome in results:
            kept: Any
            for kept, column in zip(plane.outcome, outcome, strict=True):
                kept[row] = column
            plane.done[row] = True
            progress(int(plane.done.sum()))
    return plane


def boundaries(request: Request, plane: Plane, lateness: float = 0.0) -> dict[str, Array]:
    """K [N/m] over B up to which all cells are `quiet`, and none shakes (`not shaking`), and the largest K of theory.

    One cell that is otherwise hides all above it, which may be quiet again: the map shows them."""
    assessment = plane.outcome.assessment
    return {
        "quiet": _first(request.stiffness, assessment > 0),
        "not shaking": _first(request.stiffness, assessment == SHAKING),
        **theory(request.setup, request.damping, lateness),
    }


def write_csv(path: Path, request: Request, plane: Plane) -> None:
    """A line a cell of the finished rows: B, K, what it did (0 quiet, 1 gives energy, 2 shakes), energy, growth."""
    damping, stiffness = np.meshgrid(request.damping, request.stiffness, indexing="ij")
    columns = [column[plane.done].ravel() for column in (damping, stiffness, *plane.outcome)]
    head = "damping_ns_per_m,stiffness_n_per_m,verdict,energy_given_j,growth"
    beside = path.with_name(path.name + ".part")  # no half file is ever under its name
    with naming(path):
        np.savetxt(beside, np.column_stack(columns), "%.10g", ",", header=head, comments="")
    os.replace(beside, path)


def _first(stiffness: Array, bad: Flags) -> Array:
    """The last K before the first bad one of each row; the largest K of the map where none is bad, 0 where all are."""
    before = np.concatenate([[0.0], stiffness])
    return before[np.where(bad.any(axis=1), bad.argmax(axis=1), stiffness.size)]
