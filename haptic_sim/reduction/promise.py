# SPDX-License-Identifier: Apache-2.0
"""What is known, before anything runs, of the error that a scene wishes for and its method keeps or not."""

from pathlib import Path

from haptic_device.config.files import names
from haptic_sim.method_registry import AUTO
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.measured import Measured, of_scene
from haptic_sim.scene.language import Scene, load


def kept_rows(scene: Scene) -> list[Measured]:
    """What was measured of a scene, if it is a shipped one."""
    return of_scene(scene.name) if scene.name in names("scenes") and scene == load(scene.name) else []


def unkept_wish(name: str | Path, method: str = AUTO) -> str:
    """Sentence on the `error` of a scene that its method is known, or was measured, not to keep; or "".

    SceneError, or ValueError where there is no such method.
    """
    scene = load(name)
    reduced = reduce_scene(scene, method)
    row = next((row for row in kept_rows(scene) if row.method == reduced.method), None)
    if not row:
        return reduced.unkept
    if row.error <= scene.error + row.doubt:
        return ""
    return f"error {scene.error:g} is wanted, and {row.method} was measured to have a relative error of {row.error:.2g}"
