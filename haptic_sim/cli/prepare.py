# SPDX-License-Identifier: Apache-2.0
"""Kernels compiled before the nodes that need them start, in sight of whoever waits; nothing where all are there."""

from pathlib import Path

from haptic_device.compiling import have, servo_groups
from haptic_device.parameter import read_operating_point
from haptic_sim.cli.nodes import NODES
from haptic_sim.cli.processes import Program

LOCK_STEP = "lock-step", "replay", "closed form", "methods", "local contacts"
COMMANDS = {  # what a command that starts no nodes calls
    "compare": LOCK_STEP,
    "identify": ("identification",),
    "replay": LOCK_STEP,
    "zwidth": ("wall maps", "lock-step"),
}


def prepare(programs: list[Program]) -> None:
    """What these nodes will call."""
    have(*(group for program in programs for group in _groups(program)))


def _groups(program):
    if program.name == "haptic_loopback":
        return ("loopback",)
    if program.name == "haptic_driver":
        return servo_groups(_value(program, "exchange.method"))
    if program.name != "haptic_simulation":
        return ()
    from haptic_sim.compile.groups import groups_of
    from haptic_sim.scene import load

    scene = load(Path(_value(program, "scene")))
    return groups_of(scene, _value(program, "method"), _value(program, "exchange.method"))


def _value(program, name):
    """What the node will find: given to it, or in its files, or by default."""
    found = {parameter.name: parameter.default for parameter in NODES[program.name]}
    for file in program.files:
        found |= read_operating_point(file, NODES, program.namespace)[program.name]
    return (found | program.parameters)[name]
