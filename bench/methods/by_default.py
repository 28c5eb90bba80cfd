# SPDX-License-Identifier: Apache-2.0
"""Every scene with its default method, turned and shifted many ways: worst overlap, energy created, whether finite.

Energy is relative to the largest that is about.
"""

import math
from typing import Annotated

import typer

from bench.methods.hard import JUMP, OWN_GAINS
from haptic_device.config_files import names
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load
from haptic_sim.verify import LEAST
from reference.trial import attempt, jump


def tried(name, angle, phase):
    """Outcome of one attempt at a scene."""
    scene, more = load(name), {}
    if name == "handle_jump":
        more["way"] = jump(scene, angle, JUMP)
    if name in OWN_GAINS:
        more |= {"gains": OWN_GAINS[name], "sub_step": 0.25e-3}
    seconds = min(scene.motion["duration"], 4.0)
    return attempt(scene, seconds, angle=angle, phase=phase, look_every=3, **more)


def main(
    scenes: Annotated[list[str] | None, typer.Argument(help="Scenes [all that are shipped].")] = None,
    turns: Annotated[int, typer.Option(min=1, help="Angles of the plane.")] = 8,
    phases: Annotated[int, typer.Option(min=1, help="Shares of a sub-step by which the start is shifted.")] = 4,
) -> None:
    """One line a scene."""
    print(
        f"{'scene':20} {'method':12} {'step ms':>8} {'finite':>7} {'overlap um':>11} {'created J':>10} {'relative':>9}"
    )
    for name in scenes or names("scenes"):
        outcomes = [
            tried(name, 2.0 * math.pi * (i + 0.3 * (i > 0)) / turns, (j + 0.37 * (j > 0)) / phases)
            for i in range(turns)
            for j in range(phases)
        ]
        reduced = reduce_scene(load(name))
        worst = max(outcomes, key=lambda outcome: outcome.created / max(outcome.scale, LEAST))
        print(
            f"{name:20} {reduced.method:12} {reduced.sub_step * 1e3:8g} {all(o.finite for o in outcomes)!s:>7} "
            f"{max(o.overlap for o in outcomes) * 1e6:11.3g} {max(o.created for o in outcomes):10.2g} "
            f"{worst.created / max(worst.scale, LEAST):9.2g}",
            flush=True,
        )
