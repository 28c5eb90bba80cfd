# SPDX-License-Identifier: Apache-2.0
"""The page of all scenes: a picture of each, and what its simulation takes."""

from pathlib import Path

from haptic_device.config_files import names
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.explain import explain
from haptic_sim.scene.draw import save
from haptic_sim.scene.language import Scene, load

HEAD = """# Scenes

Written by `haptic scenes --gallery docs/reference/scenes`: each scene as it starts.

* Orange is the tool, light blue can move, grey is fixed. The cross is where the tool is held.
* A ring is round a tool that is small in the picture.
* The blue dotted line is the way suggested for the handle.
* The dark line with a bar is what the scene measures: 0 at its dot, 1 at its bar.
* Circles are pins, squares are sliders. Green zigzags and spirals are springs; a dashed line is a damper alone.
* Red arrows with a speed are motors, belts, and bodies that move at the start. The black arrow is gravity.
"""


def write_gallery(folder: Path) -> None:
    """README.md and a PNG of every scene; OSError if they cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    sections = [HEAD]
    for name in names("scenes"):
        scene = load(name)
        save(scene, folder / f"{name}.png")
        sections.append(_section(name, scene))
    (folder / "README.md").write_text("\n".join(sections), encoding="utf-8")


def _section(name: str, scene: Scene) -> str:
    rows = "\n".join(f"| {question} | {answer} |" for question, answer in explain(reduce_scene(scene)))
    picture = f"![{scene.description}]({name}.png)"
    return f"## {name}\n\n{scene.description}.\n\n{picture}\n\n| | |\n|---|---|\n{rows}\n"
