# SPDX-License-Identifier: Apache-2.0
"""Which walls of a K–B plane a hand can press against until the handle stands still, in lock-step."""

import numpy as np

from haptic_device.device import wall_tapping
from haptic_device.theory.zwidth import OPERATORS, Setup, record_of


def stiffest(setup: Setup, stiffness: np.ndarray, damping: np.ndarray, hand: str = "light") -> np.ndarray:
    """Stiffest wall [N/m] of a rising grid below which all come to rest, of each damping B [N s/m]; 0 if none does.

    A wall counts where the handle does not move at all in the last quarter of the run, tapped and pressed.
    """
    walls = [np.ascontiguousarray(a.ravel()) for a in np.meshgrid(stiffness, damping, indexing="ij")]
    moving = np.zeros(walls[0].size)
    for operator in OPERATORS[hand]:
        outcomes = np.zeros(moving.size, wall_tapping.OUTCOME)
        wall_tapping.cells(record_of(setup, operator).view(np.recarray), *walls, outcomes.view(np.recarray))
        moving = np.maximum(moving, outcomes["vibration"])
    resting = np.cumprod((moving == 0.0).reshape(stiffness.size, damping.size), axis=0).sum(axis=0)
    return np.where(resting > 0, stiffness[np.maximum(resting - 1, 0)], 0.0)
