# SPDX-License-Identifier: Apache-2.0
"""How a device is excited to be identified: springs whose rest position jumps.

In x and y the spring is a pair of facing walls that overlap: within the overlap it pushes with 2K towards its centre.
About theta it is the coupling to a tool. Jumps at irregular times, large and small, at two stiffnesses, move the handle
fast (mass, delay), evenly (damping) and slowly (friction).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

DWELL = (0.03, 0.15)  # [s] between jumps
SMALL = 0.2  # of the full jump, at every third time: friction shows where forces are small
STIFFNESS = (20.0, 100.0, 400.0)  # [N/m] softest, usual, stiffest of one wall
QUICK = 50.0  # [rad/s] natural frequency of the described inertia on the stiffest rotational spring


class Jumps(NamedTuple):
    """Parameters `wall.*` of one dwell, and how long it lasts [s]."""

    normals: tuple[float, ...]
    offsets: tuple[float, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    seconds: float


def wall_jumps(centres: Sequence[float], force: float, damping: float, period: float, seed: int = 1) -> Iterator[Jumps]:
    """Endless Jumps about these centres [m] (x, or x and y), with at most so much force [N] on each.

    damping: the described b of the weakest axis [N s/m]; walls stay at an eighth of the stiffness that this b bears.
    """
    rng, usual = np.random.default_rng(seed), 0.25 * damping / period
    choices = np.clip([usual / 4.0, usual], STIFFNESS[0], STIFFNESS[1:])
    # twice the largest jump; a wall far beyond its centre would be at the force limit, and hold against nothing
    overlap = force / (2.0 * float(choices[0]))
    while True:
        stiffness = float(rng.choice(choices))
        reach = force / (4.0 * stiffness) * (SMALL if rng.random() < 1 / 3 else 1.0)
        places = [centre + reach * rng.uniform(-1.0, 1.0) for centre in centres]
        yield _pairs(places, stiffness, overlap, float(rng.uniform(*DWELL)))


class Twist(NamedTuple):
    """For one dwell: angle of the tool and its largest distance from the handle [rad], stiffness [N m/rad]."""

    angle: float
    leash: float
    stiffness: float


def tool_twists(
    centre: float, torque: float, reach: float, damping: float, inertia: float, period: float, seed: int = 2
) -> Iterator[Twist]:
    """Endless Twists about this centre [rad], at most so far [rad], with at most so much torque [N m].

    damping, inertia: as described [N m s/rad, kg m²]; the coupling stays at a quarter of the stiffness that b bears.
    """
    rng, stiffest = np.random.default_rng(seed), min(0.5 * damping / period, inertia * QUICK**2)
    while True:
        stiffness = float(rng.choice([stiffest / 4.0, stiffest]))
        far = min(reach, torque / (2.0 * stiffness)) * (SMALL if rng.random() < 1 / 3 else 1.0)
        yield Twist(centre + far * float(rng.uniform(-1.0, 1.0)), torque / stiffness, stiffness)


def _pairs(centres: Sequence[float], stiffness: float, overlap: float, seconds: float) -> Jumps:
    normals: list[float] = []
    offsets: list[float] = []
    for axis, centre in enumerate(centres):
        unit = (1.0, 0.0) if axis == 0 else (0.0, 1.0)
        normals += [*unit, -unit[0], -unit[1]]
        offsets += [overlap + centre, overlap - centre]
    count = len(offsets)
    return Jumps(tuple(v + 0.0 for v in normals), tuple(offsets), (stiffness,) * count, (0.0,) * count, seconds)
