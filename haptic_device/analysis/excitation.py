# SPDX-License-Identifier: Apache-2.0
"""How a device is shaken to be identified: pairs of facing walls that overlap, a spring whose rest position jumps.

Within the overlap the pair of one axis pushes with 2K towards its centre. Jumps of the centre at irregular times, large
and small, at two stiffnesses, move the handle fast (mass, delay), evenly (damping) and slowly (friction).
"""

from typing import NamedTuple

import numpy as np

OVERLAP = 0.05  # [m] each wall reaches beyond the centre
DWELL = (0.03, 0.15)  # [s] between jumps
SMALL = 0.2  # of the full jump, at every third time: friction shows where forces are small
STIFFNESS = (20.0, 100.0, 400.0)  # [N/m] softest, usual, stiffest of one wall


class Shake(NamedTuple):
    """Parameters `wall.*` of one dwell, and how long it lasts [s]."""

    normals: tuple
    offsets: tuple
    stiffness: tuple
    damping: tuple
    seconds: float


def shakes(centres, force, damping, period, seed=1):
    """Endless Shakes about these centres [m] (x, or x and y), with at most so much force [N] on each.

    damping: the described b of the weakest axis [N s/m]; walls stay at an eighth of the stiffness that this b bears.
    """
    rng, usual = np.random.default_rng(seed), 0.25 * damping / period
    choices = np.clip([usual / 4.0, usual], STIFFNESS[0], STIFFNESS[1:])
    while True:
        stiffness = float(rng.choice(choices))
        reach = force / (4.0 * stiffness) * (SMALL if rng.random() < 1 / 3 else 1.0)
        places = [centre + reach * rng.uniform(-1.0, 1.0) for centre in centres]
        yield _pairs(places, stiffness, float(rng.uniform(*DWELL)))


def _pairs(centres, stiffness, seconds):
    normals, offsets = (), ()
    for axis, centre in enumerate(centres):
        unit = (1.0, 0.0) if axis == 0 else (0.0, 1.0)
        normals += (*unit, -unit[0], -unit[1])
        offsets += (OVERLAP + centre, OVERLAP - centre)
    count = len(offsets)
    return Shake(tuple(v + 0.0 for v in normals), offsets, (stiffness,) * count, (0.0,) * count, seconds)
