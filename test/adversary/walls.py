# SPDX-License-Identifier: Apache-2.0
"""Searches handle paths for energy on both sides of each bound.

usage: OPENBLAS_NUM_THREADS=1 python test/adversary/walls.py [STARTS]   (threads only wait for one another here)
"""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of this package

from adversary.switching import switched_cancellation_damping
from adversary.wall_search import Display, search
from bench.reference.closed_forms import delayed_wall_damping, lagged_wall_damping, wall_damping

SIDES = (0.98, 1.02)


def cases():
    """Name, bound [KT], ticks of a path, and the display but for its physical damping."""
    for damping in (0.0, 0.3, -0.3):
        yield "wall", wall_damping(1.0, damping, 1.0), 200, {"damping": damping}
    for lag in (0.5, 4.0):
        bound = lagged_wall_damping(1.0, 0.4, 1.0, lag)
        yield "velocity lag", bound, 200, {"damping": 0.4, "lag": lag}
    for damping in (0.0, 0.25):
        bound = delayed_wall_damping(1.0, damping, 1.0, 1)
        yield "one sample late", bound, 200, {"damping": damping, "delay": 1}
    for damping in (0.0, 0.1, 0.3):
        bound = switched_cancellation_damping(1.0, damping, 1.0, 0.9)
        yield "cancelled up to the wall", bound, 24, {"damping": damping, "cancelled": 0.9}
    for damping in (0.0, 0.3):
        banded = {"damping": damping, "cancelled": 0.9, "band": 1.0}
        yield "cancelled up to a band", wall_damping(1.0, damping, 1.0), 60, banded
    late = {"delay": 1, "cancelled": 0.7, "band": 2.0}  # a tick and the delay: the way until a force answers
    yield "cancelled up to a band, one sample late", delayed_wall_damping(1.0, 0.0, 1.0, 1), 100, late


def main(starts):
    for name, bound, ticks, display in cases():
        found = [search(Display(share * float(bound), **display), ticks, starts).energy for share in SIDES]
        sides = ", ".join(f"{energy:.3g} at {share:g}" for share, energy in zip(SIDES, found, strict=True))
        print(f"{name} {display}: bound {float(bound):.4f} KT, energy found [K step^2] {sides}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 100)
