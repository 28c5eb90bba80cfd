# SPDX-License-Identifier: Apache-2.0
"""Error against cost of the steps that `impulse` takes inside a sub-step, and which of them a scene gets."""

import math

import typer

from bench.methods import hard
from haptic_device.config_files import names
from haptic_sim import verify
from haptic_sim.error_metrics import judge
from haptic_sim.pymunk_world.world import PymunkWorld
from haptic_sim.reduction import reduce_scene
from reference.case import NAMES, case
from reference.reference import reference

STEPS = (50.0, 62.5, 83.4, 125.0)
"""us."""


def main() -> None:
    """Error, overlap and exchange of every shipped scene at each step, as a table of Markdown; eight minutes."""
    heads = [f"{step:g} µs: error, overlap, exchange" for step in STEPS]
    print("\n".join(f"| {' | '.join(row)} |" for row in (["scene", "gets", *heads], ["---"] * (2 + len(heads)))))
    for name in names("scenes"):
        known, of = _case(name)
        reduced = reduce_scene(of.scene, "impulse")
        gets = f"{1e6 * reduced.sub_step / _inner(reduced):.3g}" if reduce_scene(of.scene).method == "impulse" else "–"
        cells = [_cell(of, known, reduced._replace(inside=1e-6 * step)) for step in STEPS]
        typer.echo(f"| {' | '.join([name, gets, *cells])} |")


def _case(name):
    of = case(name) if name in NAMES else hard.case(name, verify.LOOK) if name in hard.NAMES else verify.case_of(name)
    return reference(name) if name in NAMES else verify.converged(of), of


def _inner(reduced):
    return math.ceil(reduced.sub_step / reduced.inside - 1e-9)


def _cell(of, known, reduced):
    world = PymunkWorld(reduced, reduced.sub_step)
    world.couple(of.gains)
    found = judge(of, known, world, round(of.period * 1e-9 / reduced.sub_step))
    spent = verify.exchange_time(of, reduced)
    return f"{found.error:.1e}, {1e6 * found.penetration:.2g} µm, {spent:.0f} µs"
