# SPDX-License-Identifier: Apache-2.0
"""Tool samples, and local contacts, that say what the genes of a path have them say (exchange_search)."""

from haptic_device.control import contact_model, contact_solver
from haptic_device.jit import njit

MOVED, POSITION, VELOCITY, AGE, CONTACT, ENERGY, EFFORT, LOST, DEVICE = range(9)
GENES = 9
FREE = -1  # instead of a number of ticks


@njit
def sample(record, path, k, scale, past, adversary, period):
    """The tool sample that the servo finds at tick k."""
    genes, late = path[k], adversary.late
    record.tool.session = 1.0
    record.tool.age += period
    if k > 0 and genes[LOST] < adversary.loss:
        return
    record.tool.answered = record.tool.sequence = k + 1.0
    record.tool.contact = 1.0 if genes[CONTACT] > 0.0 else 0.0
    record.tool.energy += abs(genes[ENERGY]) * scale[ENERGY]
    record.tool.effort[0] += genes[EFFORT] * scale[EFFORT]
    if late < 0:
        record.tool.position[0] = genes[POSITION] * scale[POSITION]
        record.tool.velocity[0] = genes[VELOCITY] * scale[VELOCITY]
        record.tool.age = abs(genes[AGE]) * scale[AGE]
        return
    late += int(adversary.mixed * min(1.0, abs(genes[AGE])))
    then = max(0, k - late)
    held = genes[CONTACT] > 0.0 and past[then] < 0.0
    record.tool.position[0] = 0.0 if held else past[then]
    record.tool.velocity[0] = 0.0 if held else (past[then] - past[max(0, then - 1)]) / period
    record.tool.age = late * period


@njit
def contacts(memory, record, genes, scale, position, k):
    """Local contacts that say what they like: two planes anywhere, moving, giving way, rebounding, in turn renamed."""
    memory.virtual_tool.contacts.number, memory.virtual_tool.contacts.trust = k + 1.0, 1.0 if genes[AGE] < 2.5 else 0.0
    record.tool.contact_age = 0.01 * abs(genes[AGE])
    memory.virtual_tool.contacts.mass, memory.virtual_tool.contacts.inertia = 0.1, 1e-4
    memory.virtual_tool.contacts.fresh = 1.0
    for i in range(2):
        one, side = memory.virtual_tool.contacts.table[i], 1.0 if (genes[CONTACT] > 0.0) == (i == 0) else -1.0
        identity = 1.0 + i + (2.0 if genes[ENERGY] > 1.0 else 0.0)
        if one[contact_model.IDENTITY] != identity:
            memory.virtual_tool.contacts.constraints[i, contact_solver.MODE] = contact_solver.OPEN
        one[contact_model.IDENTITY], one[contact_model.NORMAL_X] = identity, side
        one[contact_model.KIND] = contact_model.FLAT_THERE
        at = genes[POSITION] if i == 0 else genes[EFFORT]
        one[contact_model.POINT_X] = position + at * scale[POSITION]
        one[contact_model.VELOCITY_X] = genes[VELOCITY] * scale[VELOCITY]
        one[contact_model.RESTITUTION] = min(1.0, abs(genes[AGE]))
        one[contact_model.MOBILITY], one[contact_model.FORCE] = max(0.0, genes[ENERGY]) * 10.0, 3.0 * genes[EFFORT]
