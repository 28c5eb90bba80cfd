# SPDX-License-Identifier: Apache-2.0
"""The servo's ticks again: from a trace, to the bit, or with other settings on the counts of a recorded hand.

A snapshot is what a tick leaves behind, settings and state; with it and the inputs of the rows that follow, every
output of these rows can be computed again.
"""

import numpy as np

from haptic_device.control import actuation_delay, contact_model, linkage, servo, tool_contacts
from haptic_device.control.records import AXES, CONTACTS, SETTINGS, STATE, TICK
from haptic_device.jit import kernel
from haptic_device.realtime import hardware_interface
from haptic_device.realtime.servo_loop import copy_tick, run_tick

IN_BAGS = {
    **{f"virtual_tool.contacts.{name}": f"near_{name}" for name in CONTACTS.names[: CONTACTS.names.index("table")]},
    **{"virtual_tool.contacts.table": "near", "virtual_tool.contacts.constraints": "rows"},
    **{"hardware.motor_limit": "device_limit", "hardware.damping": "physical_damping"},
    **{"coupling.stiffness": "stiffness", "coupling.damping": "damping", "wall.count": "walls"},
    **{f"passivity.{name}": name for name in ("margin", "surplus", "lateness")},
    **{"motion.sample_time": "latched", "motion.stale_ticks": "unseen"},
    **{"motion.handle": "world", "motion.clutch_offset": "offset"},
    **{"samples.count": "history", "samples.x": "positions_x", "samples.y": "positions_y"},
    **{"samples.theta": "positions_theta"},
    **{"enable.ramp": "engage", "fault.code": "fault", "fault.thermal_load": "warmth"},
    **{"fade.factor": "exchange_fade", "fade.released": "let_go", "rows": "table"},
    **{"virtual_tool.pose": "copy", "virtual_tool.velocity": "copy_velocity"},
}
"""group.field of a record → its name in the snapshots of all bags that there are; a field renamed since is added here.
Else it is the field's name alone for groups in ALONE, and group_field."""
ALONE = {"hardware", "virtual_tool.contacts", *STATE.names} - {"account", "coupling", "exchange", "change", "hold"}
_ACCOUNT = "short", "value", "asked", "own", "way", "more", "lacks", "one_worst", "unpaid"
_ACCOUNT += "beside", "spring_before", "fast"
MADE_ANEW = (
    {"walls.depth", "walls.whole", "wished", "trial"}
    | {f"motion.{name}" for name in ("elapsed", "unsure", "turned", "unfaded")}
    | {f"account.{name}" for name in _ACCOUNT}
)
"""Fields that a tick fills in before it reads them, or leaves at 0: no part of a snapshot."""
SINCE = (
    {"motion.sample_error", "samples.errors", "fade.apart", "hardware.stamp_error"}
    | {f"linkage.{name}" for name in linkage.NAMES}
    | {"port.joints", "motion.joint", "motion.joint_velocity", "motion.jacobian", "account.place", "account.jacobian"}
    | {"port.lever", "hardware.most_force", "hardware.step"}  # which no tick reads
)
"""Fields that bags of before lack, where they were 0."""


def _columns(prefix, dtype, within=""):
    """(path of names, name in bags, shape) of every number that a snapshot holds."""
    for name in dtype.names:
        place, part = f"{within}{name}", dtype[name]
        if part.base.names is not None and part.shape:  # a table: rows of numbers
            if place not in MADE_ANEW:
                yield (name,), f"{prefix}.{IN_BAGS.get(place, name)}", (*part.shape, part.base.itemsize // 8)
        elif part.names is not None:
            for path, *rest in _columns(prefix, part, f"{place}."):
                yield (name, *path), *rest
        elif place not in MADE_ANEW:
            plain = name if within[:-1] in ALONE else place.replace(".", "_")
            yield (name,), f"{prefix}.{IN_BAGS.get(place, plain)}", part.shape


COLUMNS = {prefix: tuple(_columns(prefix, dtype)) for prefix, dtype in (("settings", SETTINGS), ("memory", STATE))}
SNAPSHOT = np.dtype([("tick", "f8"), *((name, "f8", shape) for of in COLUMNS.values() for _, name, shape in of)])

NO_SETS = np.zeros(0, contact_model.SET).view(np.recarray)


@kernel
def recompute(settings, state, rows, sets):
    """Computes the outputs of consecutive rows again, in place, from their inputs; sets: of local contacts, by number.

    Margin, surplus and the lateness counted are no outputs of the tick: with them the driver follows the measured
    lateness, so they are taken as recorded, and what follows from the lateness is made anew.
    """
    at, ticks, contacts = 0, np.zeros(1, TICK), state[0].virtual_tool.contacts
    for k in range(rows.size):
        if rows[k].contact_set != contacts.number:
            while at < sets.size - 1 and sets[at].number < rows[k].contact_set:
                at += 1
            # modes and pushes of contacts go on from set to set, so each is taken once
            if sets.size and sets[at].number == rows[k].contact_set:
                tool_contacts.take(contacts, sets[at])
        for i in range(AXES):
            settings[0].passivity.margin[i], settings[0].passivity.surplus[i] = rows[k].margin[i], rows[k].surplus[i]
        settings[0].passivity.lateness, port = rows[k].lateness_counted, settings[0].port
        least, most, ratio = rows[k].lateness_least, rows[k].lateness_counted, rows[k].lateness_ratio
        if port.least != least or port.most != most or port.ratio != ratio:
            actuation_delay.set_lateness(port, least, most, port.period, ratio)
        # inputs as recorded; servo.tick clears the outputs
        ticks.view(np.int64)[:] = rows[k : k + 1].view(np.int64)
        servo.tick(settings[0], state[0], ticks[0])
        copy_tick(ticks, rows, k)


@kernel
def run_on_counts(settings, state, rows, tool, counts, start, first, write_delay, word):
    """As run_lockstep, on a device that is where the recorded hand had it: counts (rows, 3) instead of a plant."""
    sample, ticks = np.zeros(hardware_interface.SAMPLE), np.zeros(1, TICK)
    tick, period = ticks[0], np.int64(round(settings[0].period * 1e9))
    tick.sensors.lateness, tick.sensors.write_delay = write_delay * 1e-9, write_delay * 1e-9
    tick.sensors.command = word
    for k in range(rows.size):
        deadline = start + k * period
        # a device without delay
        sample[hardware_interface.LATCHED] = deadline
        sample[hardware_interface.COUNTS : hardware_interface.COUNTS + AXES] = counts[k]
        run_tick(settings[0], state[0], tool[0], tick, first + k, deadline, sample, 1)
        copy_tick(ticks, rows, k)


def snapshot_of(tick, settings, state):
    """SNAPSHOT array of one, of what this tick (number) has left behind."""
    record = np.zeros(1, SNAPSHOT)
    record["tick"] = tick
    for part, columns in zip((settings, state), COLUMNS.values(), strict=True):
        for path, name, _ in columns:
            record[name] = _numbers(_at(part, path))
    return record


def parts_of(snapshot):
    """SETTINGS and STATE arrays of one, of a SNAPSHOT record. Raises ValueError if its fields are not today's."""
    parts = np.zeros(1, SETTINGS), np.zeros(1, STATE)
    for part, columns in zip(parts, COLUMNS.values(), strict=True):
        for path, name, _ in columns:
            if name not in snapshot.dtype.names and ".".join(path) in SINCE:
                continue
            if name not in snapshot.dtype.names:
                raise ValueError(f"the snapshots lack {name}: the bag was recorded by another version")
            field = _numbers(_at(part, path))
            field[...] = snapshot[name].reshape(field.shape)  # a bag has tables as rows of numbers
    return parts


def _numbers(field):
    """A field as numbers, a table as rows of them; not copied."""
    return field.view("f8").reshape(*field.shape, -1) if field.dtype.names else field


def _at(part, path):
    for name in path:
        part = part[name]
    return part
