# SPDX-License-Identifier: Apache-2.0
"""The page of all scenes: a picture and a short film of each, and what its simulation takes."""

import math
from collections.abc import Callable
from html import escape
from pathlib import Path

from haptic_device.config_files import names
from haptic_sim.film.gif import write_gif
from haptic_sim.film.scene_run import film_of_scene
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.explain import explain
from haptic_sim.scene.draw import save
from haptic_sim.scene.language import Scene, load

HEAD = """# Scenes

Written by `haptic scenes --gallery docs/reference/scenes`. Each scene has a picture of its start, and a film of the
simulated hand that leads the tool along the suggested way. The film is made in lock-step with the gains of
`config/demo.yaml`.

In the picture:

* Orange is the tool, light blue can move, grey is fixed. The cross is where the tool is held.
* A ring is round a tool that is small in the picture.
* The blue dotted line is the way suggested for the handle.
* The dark line with a bar is what the scene measures: 0 at its dot, 1 at its bar.
* Circles are pins, squares are sliders. Green zigzags and spirals are springs; a dashed line is a damper alone.
* Red arrows with a speed are motors, belts, and bodies that move at the start. The black arrow is gravity.

In the film, the blue disc is the handle, and a purple dot is a contact. The arrow at a contact is the force on the
first of the two bodies. The numbers are the time and the force on the hand. Scenes with a task come first.
"""


def write_gallery(folder: Path, show: Callable[[int, str], None] = lambda done, what: None) -> None:
    """README.md, a PNG and a GIF of every scene; show(scenes done, what is next). OSError if they cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    scenes = {name: load(name) for name in names("scenes")}
    sections, ordered = [HEAD], sorted(scenes.items(), key=lambda each: each[1].task is None)
    for number, (name, scene) in enumerate(ordered):
        show(number, name)
        save(scene, folder / f"{name}.png")
        write_gif(film_of_scene(scene), folder / f"{name}.gif", math.inf)
        sections.append(_section(name, scene))
    show(len(scenes), "done")
    (folder / "README.md").write_text("\n".join(sections), encoding="utf-8")


def _section(name: str, scene: Scene) -> str:
    rows = "\n".join(f"| {question} | {answer} |" for question, answer in explain(reduce_scene(scene)))
    picture = f"![{scene.description}, at the start]({name}.png)"
    film = f'<img src="{name}.gif" loading="lazy" alt="{escape(scene.description)}, a film">'
    film = f"<details{' open' if scene.task else ''}><summary>Film</summary>{film}</details>"
    return f"## {name}\n\n{scene.description}.\n\n{picture}\n\n{film}\n\n| | |\n|---|---|\n{rows}\n"
