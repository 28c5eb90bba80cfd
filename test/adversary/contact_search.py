# SPDX-License-Identifier: Apache-2.0
"""Search for local contacts and a handle path by which the tool in the servo gives the operator energy.

As exchange_search, with three axes and sets that say what they like in each tick: features of all kinds anywhere near
the copy, moving, turning, giving way, with friction and restitution, in groups, renamed or gone; the tool's mass and
gravity; how old all that is. Given to the operator is Σ f · Δx − b Δx²/T over the axes.
"""

import math
from typing import NamedTuple

import numpy as np

from adversary.exchange_search import booked, engaged
from haptic_device.control import contact_model, contact_solver, enable_state, faults, records, servo
from haptic_device.jit import kernel, njit

FEATURES = 4  # of the eight places
OWN = 16  # genes of a feature
MOVED, TOOL, AGES, LOST, WHOLE, FIRST = 0, 3, 9, 11, 12, 16  # handle; tool's place and velocity; mass, gravity, trust
GENES = FIRST + FEATURES * OWN


class Found(NamedTuple):
    """Largest energy given [J]; of all paths tried the most that the books credited beyond the truth [J], how many
    ticks the copy moved in, how many it stayed in; the path."""

    energy: float
    overcredit: float
    moved: int
    stayed: int
    path: np.ndarray


@kernel
def energy_given(settings, memory, row, path, scale, loss, watched):
    """Largest energy given [J] at any tick of a path's second half. scale: of handle moves and of places near it."""
    record, one, period = row[0], memory[0], settings[0].period
    position, given, most = np.zeros(3), 0.0, -np.inf
    for k in range(len(path)):
        genes = path[k]
        record.sensors.latched = record.sensors.deadline = (k + 1) * period * 1e9
        record.sensors.command, record.sensors.device_status = enable_state.ENABLE, faults.FRESH
        for i in range(3):
            record.sensors.counts[i] = np.round(position[i] / abs(settings[0].hardware.position_per_count[i]))
        if k == 0 or not genes[LOST] < loss:
            _tool(record, genes, scale, position, k)
            _set(one, genes, scale, k)
        record.tool.age += period
        record.tool.contact_age += period
        servo.tick(settings[0], one, record)
        watched[0] = max(watched[0], given + booked(settings[0], one, record))
        watched[1] += record.output.local
        for i in range(3):
            moved = genes[MOVED + i] * scale[0, i]
            given += record.output.force_on_handle[i] * moved - settings[0].hardware.damping[i] * moved * moved / period
            position[i] += moved
        if 2 * k >= len(path):
            most = max(most, given)
    watched[2] += one.virtual_tool.stays + one.virtual_tool.unsolved
    return most


@njit
def _tool(record, genes, scale, position, k):
    record.tool.session, record.tool.contact = 1.0, 0.0
    record.tool.answered = record.tool.sequence = k + 1.0
    record.tool.age, record.tool.contact_age = 0.003 * abs(genes[AGES]), 0.003 * abs(genes[AGES + 1])
    for i in range(3):
        record.tool.position[i] = position[i] + genes[TOOL + i] * 0.2 * scale[1, i]
        record.tool.velocity[i] = genes[TOOL + 3 + i] * 0.1


@njit
def _set(memory, genes, scale, k):
    contacts = memory.virtual_tool.contacts
    contacts.number, contacts.fresh, contacts.extent = k + 1.0, 1.0, 0.0
    contacts.mass, contacts.inertia = 0.1 * 10.0 ** (0.3 * genes[WHOLE]), 1e-4 * 10.0 ** (0.3 * genes[WHOLE])
    contacts.gravity[0], contacts.gravity[1] = 10.0 * genes[WHOLE + 1], 10.0 * genes[WHOLE + 2]
    contacts.trust = 0.0 if genes[WHOLE + 3] > 2.5 else 10.0
    for i in range(3):
        contacts.pose[i] = memory.virtual_tool.pose[i]
    for f in range(FEATURES):
        _feature(memory, genes[FIRST + f * OWN :], scale, f)


@njit
def _feature(memory, own, scale, f):
    one, identity = memory.virtual_tool.contacts.table[f], 1.0 + f + (FEATURES if own[0] > 1.0 else 0.0)
    identity = 0.0 if own[0] < -1.5 else identity
    if one[contact_model.IDENTITY] != identity:
        memory.virtual_tool.contacts.constraints[f, contact_solver.MODE] = (
            contact_solver.OPEN if identity > 0.0 else contact_solver.UNUSED
        )
        memory.virtual_tool.contacts.pushed[f], memory.virtual_tool.contacts.shifted[f] = 0.0, 0.0
    one[contact_model.IDENTITY], one[contact_model.GROUP] = identity, 1.0 if own[1] > 1.5 else 0.0
    one[contact_model.KIND] = (
        contact_model.ROUND if own[2] > 1.2 else (contact_model.FLAT_HERE if own[2] > 0.3 else contact_model.FLAT_THERE)
    )
    angle = math.pi * own[3]
    one[contact_model.NORMAL_X], one[contact_model.NORMAL_Y] = math.cos(angle), math.sin(angle)
    one[contact_model.TOOL_X], one[contact_model.TOOL_Y] = 0.05 * own[4], 0.05 * own[5]
    c, s = math.cos(memory.virtual_tool.pose[2]), math.sin(memory.virtual_tool.pose[2])
    near = 0.3 * own[6] * scale[1, 0]  # the gap, about
    x, y = 0.05 * (c * own[4] - s * own[5]), 0.05 * (s * own[4] + c * own[5])
    one[contact_model.POINT_X] = memory.virtual_tool.pose[0] + x - near * one[contact_model.NORMAL_X]
    one[contact_model.POINT_Y] = memory.virtual_tool.pose[1] + y - near * one[contact_model.NORMAL_Y]
    flat = one[contact_model.KIND] != contact_model.ROUND
    one[contact_model.RADIUS] = 0.005 * max(0.0, own[7]) if flat else 1e-3 * abs(own[7])
    one[contact_model.TOOL_RADIUS] = 0.5 * one[contact_model.RADIUS]
    one[contact_model.LOW], one[contact_model.HIGH] = -0.01, 0.01
    one[contact_model.FRICTION], one[contact_model.RESTITUTION] = max(0.0, own[8]), min(1.0, max(0.0, own[9]))
    one[contact_model.VELOCITY_X], one[contact_model.VELOCITY_Y] = 0.3 * own[10], 0.3 * own[11]
    one[contact_model.TURN_RATE], one[contact_model.MOBILITY] = 3.0 * own[12], 10.0 * max(0.0, own[13])
    one[contact_model.SLIP_MOBILITY], one[contact_model.FORCE] = 10.0 * max(0.0, own[14]), 5.0 * own[15]


def search(settings, ticks=120, evaluations=2000, loss=0.0, seed=0):
    """Evolution strategy with one parent, one child and a step that adapts to success. settings: of three axes."""
    random = np.random.default_rng(seed)
    stretch = 5.0 / settings["coupling"]["stiffness"][0]
    way = 2.5 * settings["period"][0] / settings["hardware"]["damping"][0] * np.array([1.0, 1.0, 0.05])
    scale = np.stack([way, stretch])
    lost = -np.inf if loss <= 0.0 else float(np.quantile(random.normal(size=4000), loss))
    best, score, size, watched = np.zeros((ticks, GENES)), -np.inf, 0.5, np.array([-np.inf, 0.0, 0.0])
    for _ in range(evaluations):
        child = np.clip(best + size * _change(random, ticks), -3.0, 3.0)
        memory, row = engaged()
        value = energy_given(settings, memory, row.view(records.TICK), child, scale, lost, watched)
        better = value > score
        size = min(2.0, max(0.02, size * (1.5 if better else 0.97)))
        best, score = (child, value) if better else (best, score)
    return Found(score, float(watched[0]), int(watched[1]), int(watched[2]), best)


def _change(random, ticks):
    """A change of some genes over a stretch of ticks, smooth or tick by tick."""
    wide = int(2.0 ** random.uniform(0.0, 5.0))
    start, length = random.integers(0, ticks), int(2.0 ** random.uniform(0.0, np.log2(ticks)))
    change = np.zeros((ticks, GENES))
    rows = random.normal(size=(-(-length // wide), GENES)) * (random.random(GENES) < random.uniform(0.05, 0.6))
    change[start : start + length] = np.repeat(rows, wide, axis=0)[: min(length, ticks - start)]
    return change
