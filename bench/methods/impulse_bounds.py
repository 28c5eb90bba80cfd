# SPDX-License-Identifier: Apache-2.0
"""What `impulse` carries: a block that falls on a tower of lighter ones, and a light tool that presses a plate.

Of each the deepest overlap, measured with the shapes, and the energy created by the largest about, the worst of some
heights of fall. haptic_sim/reduction/method_choice.py has the bound that follows.
"""

from bench.methods.hard import CREATED, LEAST, OVERLAP
from haptic_sim.scene.language import load, parse
from reference.trial import attempt

RATIOS, TOWERS = (1.0, 3.0, 10.0, 30.0, 60.0, 100.0, 300.0, 1000.0), (1, 2, 5, 10, 20)
GAPS, SIZE = (0.0, 0.5e-3, 2e-3, 10e-3, 30e-3, 50e-3), 0.01
"""m."""
GRAMS = (10.0, 1.0, 0.1, 0.01)


def struck(ratio, count, gap):
    """A block that falls by `gap` [m] on a tower of blocks of 10 g which are so many times lighter."""

    def block(k):
        place = [0.0, (k + 0.5) * SIZE + (gap if k == count else 0.0), 0.0]
        return {
            "name": f"b{k}",
            "mass": 0.01 * (ratio if k == count else 1.0),
            "material": "wood",
            "pose": place,
            "shapes": [{"box": {"size": [3.0 * SIZE, SIZE]}}],
        }

    floor = {"name": "floor", "fixed": True, "material": "wood", "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    tool = {"mass": 0.1, "pose": [0.5, 0.5, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
    return parse(
        {
            "name": "struck",
            "gravity": [0.0, -9.81],
            "materials": {"wood": {"friction": 0.5}},
            "tool": tool,
            "bodies": [floor, *(block(k) for k in range(count + 1))],
            "method": "impulse",
            "motion": {"name": "hold", "start": tool["pose"]},
        },
        "struck",
    )


def light(grams):
    """A square tool of so many grams against a plate; its inertia goes with its mass."""
    scene = load("light_tool")
    tool = scene.tool.model_copy(update={"mass": grams * 1e-3, "inertia": grams * scene.tool.inertia})
    return scene.model_copy(update={"tool": tool, "motion": scene.motion | {"duration": 0.7}, "method": "impulse"})


def worst(scenes, seconds):
    """(deepest overlap [m], energy created over the largest about)."""
    found = [attempt(scene, seconds) for scene in scenes]
    return max(one.overlap for one in found), max(one.created / max(one.scale, LEAST) for one in found)


def cell(overlap, created):
    """Both, in um and percent; * marks what is beyond what a hard case may."""
    return f"{1e6 * overlap:.0f} um, {100.0 * created:.1g} %{'' if overlap <= OVERLAP and created <= CREATED else ' *'}"


def main() -> None:
    """What `impulse` carries: a table of towers, and lines of light tools."""
    print("| on a tower of | " + " | ".join(f"{ratio:g} times as heavy" for ratio in RATIOS) + " |")
    print("|---" * (len(RATIOS) + 1) + "|")
    for count in TOWERS:
        row = [cell(*worst([struck(ratio, count, gap) for gap in GAPS], 0.3)) for ratio in RATIOS]
        print(f"| {count} | " + " | ".join(row) + " |", flush=True)
    for grams in GRAMS:
        print(f"tool of {grams:g} g: {cell(*worst([light(grams)], 0.7))}", flush=True)
