# SPDX-License-Identifier: Apache-2.0
"""The hard cases whose default method takes seconds; test/unit tries all others."""

import pytest

from bench.methods.hard import verdict
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load


@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", ["spinning_wrench", "peg_jammed"])
def test_a_hard_case_is_survived_by_the_method_that_it_gets_by_default(name):
    assert reduce_scene(load(name)).method == "impulse"
    found = verdict(name, "impulse", 1)
    assert found.survives, found
