# SPDX-License-Identifier: Apache-2.0
"""A figure that a haptics researcher would check with a calculator, at sub-steps of 0.1 ms.

Pendulum, impacts, incline and four-bar stand in test_partitioned.py, restitution and sliding in test_world.py, the
peg in its hole in test_insertion.py.
"""

import math

import pytest

from haptic_sim.method.partitioned import Partitioned
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

H = 1e-4


def test_a_wrench_turns_freely_as_far_as_jaw_and_nut_let_it():
    """±(30° − acos((1 + c/s) cos 30°)), across flats s = 17 mm, jaw wider by c = 0.1 mm: ±0.58901°."""
    turned = []
    for side in (-1.0, 1.0):
        method = Partitioned(reduce_scene(load("wrench_on_nut")), H)
        method.couple(Coupling(100.0, 10.0))
        handle = 0.1, side * 0.004, 0.0
        method.step(held(handle), 10000)
        turned.append(math.degrees(method.pose("tool")[2] - method.pose("nut")[2]))
    assert turned == pytest.approx([-0.58901, 0.58901], rel=0.01)
