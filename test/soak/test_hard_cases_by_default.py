# SPDX-License-Identifier: Apache-2.0
"""Up to which load `impulse` is chosen; test/unit/test_hard_cases.py has the cases themselves."""

import pytest

from bench.methods.hard_cases import CREATED, LEAST, OVERLAP
from bench.reference.trial import attempt
from haptic_sim.reduction.method_choice import LOAD
from haptic_sim.scene.language import parse

GAPS, SIZE = (0.0, 0.5e-3, 2e-3, 10e-3, 30e-3, 50e-3), 0.01
"""m."""


def struck(ratio, count, gap):
    """A block that falls by `gap` [m] on a tower of blocks of 10 g which are so many times lighter."""
    blocks = [
        {
            "name": f"b{k}",
            "mass": 0.01 * (ratio if k == count else 1.0),
            "material": "wood",
            "pose": [0.0, (k + 0.5) * SIZE + (gap if k == count else 0.0), 0.0],
            "shapes": [{"box": {"size": [3.0 * SIZE, SIZE]}}],
        }
        for k in range(count + 1)
    ]
    floor = {"name": "floor", "fixed": True, "material": "wood", "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    tool = {"mass": 0.1, "pose": [0.5, 0.5, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
    content = {"name": "struck", "gravity": [0.0, -9.81], "materials": {"wood": {"friction": 0.5}}, "method": "impulse"}
    motion = {"name": "hold", "start": tool["pose"]}
    return parse(content | {"tool": tool, "bodies": [floor, *blocks], "motion": motion}, "struck")


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("ratio", "count", "carried"),
    [(60.0, 1, True), (30.0, 2, True), (10.0, 5, True), (1.0, 15, True), (1000.0, 1, False), (100.0, 5, False)],
)
def test_impulse_carries_a_tower_up_to_the_load_at_which_it_is_chosen_and_not_one_far_beyond(ratio, count, carried):
    found = [attempt(struck(ratio, count, gap), 0.3) for gap in GAPS]
    well = all(one.overlap <= OVERLAP and one.created <= CREATED * max(one.scale, LEAST) for one in found)
    assert (well, ratio * count <= LOAD) == (carried, carried)
