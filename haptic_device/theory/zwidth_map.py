# SPDX-License-Identifier: Apache-2.0
"""A map of the K–B plane: rows of cells over all cores."""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haptic_device.os_errors import naming
from haptic_device.theory.quantity import Array, Flags, finite, not_negative
from haptic_device.theory.sweep import spread
from haptic_device.theory.zwidth import SHAKING, Outcome, Setup, check_setup, operators_of, run_cells, theory


class Request(NamedTuple):
    """Device, operators and walls of a map of the K–B plane.

    Attributes:
        setup: the device.
        operator: name of the operators, see `operators_of`.
        stiffness: K of the columns [N/m], rising, (k).
        damping: B of the rows [N s/m], (b).

    Examples:
        >>> import numpy as np
        >>> from haptic_device.theory.zwidth import Setup
        >>> from haptic_device.theory.zwidth_map import Request
        >>> Request(Setup(0.1, 1.0, 0.001), "none", np.array([1000.0, 4000.0]), np.array([0.0])).operator
        'none'
    """

    setup: Setup
    operator: str
    stiffness: Array
    damping: Array


class Plane(NamedTuple):
    """A map of the K–B plane.

    Attributes:
        outcome: results of the cells, arrays (b, k).
        done: which rows are finished, (b).

    Examples:
        >>> import numpy as np
        >>> from haptic_device.theory.zwidth import Setup
        >>> from haptic_device.theory.zwidth_map import Request, draw_map
        >>> axes = np.array([1000.0, 4000.0]), np.array([0.0])
        >>> plane = draw_map(Request(Setup(0.1, 1.0, 0.001), "none", *axes), workers=1)
        >>> plane.outcome.assessment.shape, bool(plane.done.all())
        ((1, 2), True)
    """

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
    """Runs all cells of a map, row by row.

    Raises ValueError with one sentence for a value out of range, and for a scheduler that cannot be reached.

    Args:
        request: device, operators and walls of the map.
        workers: number of threads; the cells run without Python's interpreter lock.
        progress: called after each row with the number of rows that are done.
        scheduler: address of a Dask scheduler whose workers run the rows instead.
        plane: an empty map to fill; after an interruption it has the finished rows.

    Examples:
        >>> import numpy as np
        >>> from haptic_device.theory.zwidth import Setup
        >>> from haptic_device.theory.zwidth_map import Request, draw_map
        >>> axes = np.array([1000.0, 4000.0]), np.array([0.0])
        >>> draw_map(Request(Setup(0.1, 1.0, 0.001), "none", *axes), workers=1).outcome.assessment.tolist()
        [[0, 2]]
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
    """Largest stiffness [N/m] for the damping of each row of a map, {name: (b)}: from the map, and from theory.

    Up to `quiet` all cells are quiet. Up to `not shaking` no cell shakes. The others are the limits of `zwidth.theory`.
    A limit ends at the first cell that fails, even if cells at higher stiffness are quiet again.

    Args:
        request: what the map is of.
        plane: the map, from `draw_map`.
        lateness: as in `theory` [s].

    Examples:
        >>> import numpy as np
        >>> from haptic_device.theory.zwidth import Setup
        >>> from haptic_device.theory.zwidth_map import Request, boundaries, draw_map
        >>> request = Request(Setup(0.1, 1.0, 0.001), "none", np.array([1000.0, 4000.0]), np.array([0.0]))
        >>> limits = boundaries(request, draw_map(request, workers=1))
        >>> print(limits["quiet"], limits["passive"].round(3))
        [1000.] [2000.]
    """
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
