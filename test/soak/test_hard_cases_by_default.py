# SPDX-License-Identifier: Apache-2.0
"""Every hard case with the method that it gets by default, whatever that is."""

import pytest

from haptic_sim.bench.hard import HARD, verdict
from haptic_sim.compile import compile_scene
from haptic_sim.scene import load


@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", HARD)
def test_a_hard_case_is_survived_by_the_method_that_it_gets_by_default(name):
    found = verdict(name, compile_scene(load(name)).method, 2)
    assert found.survives, found
