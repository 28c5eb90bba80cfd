# SPDX-License-Identifier: Apache-2.0
"""Kernels compiled before the nodes that need them start, in sight of whoever waits; nothing where all are there."""

from pathlib import Path

from haptic_device.config.parameter_files import read_operating_point
from haptic_device.config.parameter_types import defaults
from haptic_device.jit import ensure_compiled
from haptic_display.run.processes import Program
from haptic_sim.node.parameters import NODES

NODES_ALONE = {  # what a node calls, whatever its parameters are
    "haptic_bridge": ("bridge",),
    "haptic_driver": ("servo", "exchange"),
    "haptic_loopback": ("loopback",),
}
LOCK_STEP = "lock-step", "replay", "closed form", "methods", "local contacts"
COMMANDS = {  # what a command that starts no nodes calls
    "compare": LOCK_STEP,
    "identify": ("identification",),
    "replay": LOCK_STEP,
    "zwidth": ("wall maps", "lock-step"),
}


def prepare(programs: list[Program]) -> None:
    """What these nodes will call."""
    ensure_compiled(*(entry for program in programs for entry in _entries(program)))


def promise(programs: list[Program]) -> str:
    """Sentence on the `error` that the scene of a simulation among these nodes wishes for and will not get; or ""."""
    from haptic_sim.reduction.promise import unkept_wish

    simulations = [program for program in programs if program.name == "haptic_simulation"]
    said = [unkept_wish(Path(value_of(program, "scene")), value_of(program, "method")) for program in simulations]
    return "; ".join(filter(None, said))


def _entries(program):
    if program.name != "haptic_simulation":
        return NODES_ALONE.get(program.name, ())
    from haptic_sim.exchange.simulation import kernels_of
    from haptic_sim.reduction import reduce_scene
    from haptic_sim.scene.language import load

    reduced = reduce_scene(load(Path(value_of(program, "scene"))), value_of(program, "method"))
    return kernels_of(reduced, value_of(program, "exchange.method"))


def value_of(program: Program, name: str):
    """The parameter that the node will find: given to it, or in its files, or by default."""
    found = defaults(NODES[program.name])
    for file in program.files:
        found |= read_operating_point(file, NODES, program.namespace)[program.name]
    return (found | program.parameters)[name]
