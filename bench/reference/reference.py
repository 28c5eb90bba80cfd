# SPDX-License-Identifier: Apache-2.0
"""Where the bodies of a case really go: closed forms where there are any, else a converged solution that is stored.

A stored one is the partitioned method's at a step of 1 us; the file's head says how far that is from 2 us, which is as
far as it may be off. `python -m bench reference NAME` makes it again.
"""

import functools
from pathlib import Path

import numpy as np

from bench.reference import exact
from bench.reference.case import case
from bench.reference.exact_four_bar import four_bar
from haptic_sim.lockstep.error_metrics import Case, Reference, apart, solution

CLOSED = {
    "free_space": exact.free_space,
    "pendulum": exact.pendulum,
    "four_bar_free": four_bar,
    "four_bar": four_bar,
    "slider": exact.slider,
    "slider_free": exact.slider_free,
    "wall": exact.wall,
    "incline": exact.incline,
    "zeno_ball": exact.zeno_ball,
    "collinear_1e3": exact.collinear,
    "falling_rod": exact.falling_rod,
}
STORED = Path(__file__).parent / "converged"
FINE = (2000, 1000)
"""ns; the steps of a converged solution."""


@functools.lru_cache
def reference(name: str) -> Reference:
    """Reference of the case called `name`. ValueError if it has none."""
    if name in CLOSED:
        return Reference(CLOSED[name](case(name)), "closed form", 0.0)
    path = STORED / f"{name}.csv"
    if not path.is_file():
        raise ValueError(f"scene {name!r} has no reference yet; python -m bench reference {name} makes it")
    return _read(path)


def make(of: Case) -> Reference:
    """The converged solution of a case."""
    coarse, fine = (solution(of, "partitioned", step) for step in FINE)
    doubt = max(float(apart(coarse[name], fine[name], radius).max()) for name, radius in of.bodies().items())
    return Reference(fine, f"partitioned at {FINE[1]} ns", doubt)


def write(name: str, made: Reference) -> Path:
    """Stores a converged solution."""
    STORED.mkdir(exist_ok=True)
    names = sorted(made.poses)
    head = (
        f"{name}: {made.source}; twice the step differs by up to {made.doubt:.2e} m; "
        f"made by: python -m bench reference {name}\ntime,"
        + ",".join(f"{body}.{k}" for body in names for k in ("x", "y", "theta"))
    )
    count = len(made.poses[names[0]])
    table = np.column_stack([np.arange(count) * case(name).look * 1e-9, *(made.poses[body] for body in names)])
    path = STORED / f"{name}.csv"
    np.savetxt(path, table, "%.12g", ",", header=head)
    return path


def _read(path):
    head, names = path.read_text(encoding="utf-8").splitlines()[:2]
    bodies = list(dict.fromkeys(column.rsplit(".", 1)[0] for column in names.lstrip("# ").split(",")[1:]))
    table = np.loadtxt(path, delimiter=",")
    poses = {body: table[:, 1 + 3 * k : 4 + 3 * k] for k, body in enumerate(bodies)}
    source, rest = head.lstrip("# ").split(": ", 1)[1].split("; twice the step differs by up to ")
    return Reference(poses, source, float(rest.split(" m;")[0]))
