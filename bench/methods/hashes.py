# SPDX-License-Identifier: Apache-2.0
"""Whether the simulation still gives the same bits: a hash of every exchange of a second, scene by scene.

Each scene is led by its own motion at 1 kHz, by each method that can model it at a port that ships the handle as it is,
and by its default method at each other port. The hash is over pose, velocity and force of the tool, the contact, the
energy, the poses of all bodies and the ledger, of each exchange. Two tables of two commits are compared line by line.
"""

import hashlib
import os
import struct
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from bench.jobs import WORKERS, Kept, listed, read_csv, sweep
from haptic_device.config.files import names
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.lockstep.rollout import EXCHANGE_NS, GAINS, hand
from haptic_sim.method_registry import METHODS
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

PORTS = ("direct", "pspm")
SHIPPED = 0.02
"""J/s that the hand ships at a port that asks for energy: more than some motions take, less than others."""


class Hash(NamedTuple):
    """Scene, method and port, and the hash: or why there is none."""

    scene: str
    method: str
    port: str
    hash: str


def hashed(scene: str, method: str, port: str, seconds: float) -> Hash:
    """The hash of a scene led by its motion for so long."""
    try:
        simulation = Simulation(reduce_scene(load(scene), method or None), port=port_of(port))
    except ValueError as reason:
        return Hash(scene, method, port, f"cannot: {' '.join(str(reason).split())}")
    lead, found, before = hand(simulation.scene), hashlib.sha256(), None
    bodies = [body.name for body in simulation.scene.bodies]
    for k in range(round(seconds * 1e9) // EXCHANGE_NS):
        place = lead(1e-9 * k * EXCHANGE_NS)
        rate = tuple(1e9 * (b - a) / EXCHANGE_NS for a, b in zip(before or place, place, strict=True))
        before, energy = place, 1e-9 * k * EXCHANGE_NS * SHIPPED
        tool = simulation.exchange(HandleSample(k * EXCHANGE_NS, place, rate, *GAINS, energy=energy))
        numbers = [*tool.position, *tool.velocity, *tool.force_on_tool, float(tool.contact), tool.energy]
        for body in bodies:
            numbers += simulation.method.pose(body)
        numbers += simulation.ledger.balance
        found.update(struct.pack(f"<{len(numbers)}d", *numbers))
    return Hash(scene, method, port, found.hexdigest()[:16])


def main(
    out: Annotated[Path | None, typer.Option(help="CSV file of the hashes; what it has is not made again.")] = None,
    against: Annotated[Path | None, typer.Option(help="CSV file of another commit, to be compared with.")] = None,
    scenes: Annotated[str | None, typer.Option(help="With commas between [all].")] = None,
    seconds: Annotated[float, typer.Option(min=0.001, help="Simulated time.")] = 1.0,
    workers: Annotated[int | None, typer.Option(min=1, help=WORKERS)] = None,
) -> None:
    """Hash every scene's poses and forces by each method; with another commit's table, exit code 1 if one differs."""
    known = listed(scenes, names("scenes"))
    wanted = [(scene, method, "direct") for scene in known for method in METHODS]
    wanted += [(scene, "", port) for scene in known for port in PORTS]
    kept = Kept(out, Hash, lambda row: row[:3])
    sweep(hashed, {job: (*job, seconds) for job in wanted}, kept, workers or len(os.sched_getaffinity(0)))
    before = {row[:3]: row for row in read_csv(against, Hash)} if against else {}
    differing = [row for key, row in kept.known.items() if before.get(key, row) != row]
    for row in differing if against else kept.known.values():
        print(f"{row.scene:20} {row.method or 'by default':16} {row.port:7} {row.hash}")
    if against:
        print(f"{len(differing)} of {len(before)} hashes differ")
    raise typer.Exit(1 if differing else 0)
