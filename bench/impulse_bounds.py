# SPDX-License-Identifier: Apache-2.0
"""How far `impulse` carries: a block on a lighter one, a tower, a light tool, each pressed by the tool.

`python bench/impulse_bounds.py`: deepest overlap measured with the shapes, and energy created by the largest about.
haptic_sim/compile/beyond.py has the bounds that follow: 0.1 mm and a hundredth of the energy are what a hard case may.
"""

from haptic_sim.bench.hard import LEAST
from haptic_sim.scene import load
from haptic_sim.trial import attempt

SECONDS = 0.7


def on_lighter(ratio):
    """A block of 10 kg on one that is so many times lighter."""
    scene = load("heavy_on_light_1e3")
    light = scene.bodies[1].model_copy(update={"mass": 10.0 / ratio})
    return scene.model_copy(update={"bodies": (scene.bodies[0], light, *scene.bodies[2:])})


def tower(height):
    """So many equal blocks on each other, which the tool comes to press on."""
    scene = load("stack_20")
    blocks = [body for body in scene.bodies if not body.fixed]
    low = blocks[height - 1].pose[1] - blocks[-1].pose[1]
    motion = {key: (x, y + low, theta) for key in ("start", "target") for x, y, theta in [scene.motion[key]]}
    return scene.model_copy(update={
        "bodies": tuple(body for body in scene.bodies if body.fixed or body in blocks[:height]), "measure": {},
        "tool": scene.tool.model_copy(update={"pose": motion["start"]}),
        "motion": scene.motion | motion | {"duration": SECONDS},
    })


def light_tool(grams):
    """A square tool of so many grams against a plate; its inertia goes with its mass."""
    scene = load("light_tool")
    tool = scene.tool.model_copy(update={"mass": grams * 1e-3, "inertia": grams * scene.tool.inertia})
    return scene.model_copy(update={"tool": tool, "motion": scene.motion | {"duration": SECONDS}})


FAMILIES = {
    "mass ratio": (on_lighter, (1e2, 1e3, 3e3, 1e4, 3e4, 1e5, 1e6)), "tower": (tower, (5, 8, 10, 12, 15, 20)),
    "tool of grams": (light_tool, (10.0, 1.0, 0.1, 0.01)),
}


def main():
    """One line a scene."""
    print(f"{'family':14} {'size':>8} {'finite':>7} {'overlap um':>11} {'created':>9}")
    for family, (make, sizes) in FAMILIES.items():
        for size in sizes:
            scene = make(size).model_copy(update={"method": "impulse"})
            found = attempt(scene, SECONDS, look_every=5)
            print(f"{family:14} {size:8g} {found.finite!s:>7} {found.overlap * 1e6:11.3g} "
                  f"{found.created / max(found.scale, LEAST):9.1e}", flush=True)


if __name__ == "__main__":
    main()
