# SPDX-License-Identifier: Apache-2.0
"""The servo's ticks again: from a trace, to the bit, or with other settings on the counts of a recorded hand.

A snapshot is what a tick leaves behind, settings and memory; with it and the inputs of the rows that follow, every
output of these rows can be computed again.
"""

import numpy as np

from haptic_device.control import contact_model, servo, virtual_tool
from haptic_device.jit import kernel
from haptic_device.realtime import hardware_interface
from haptic_device.realtime.servo_loop import fill_contacts, fill_inputs


def _fields(prefix, dtype):
    return [(f"{prefix}.{name}", "f8", dtype[name].shape) for name in dtype.names]


SNAPSHOT = np.dtype([("tick", "f8"), *_fields("settings", servo.SETTINGS), *_fields("memory", servo.MEMORY)])

NO_SETS = np.zeros(0, contact_model.SET).view(np.recarray)


@kernel
def recompute(settings, memory, rows, sets):
    """Computes the outputs of consecutive rows again, in place, from their inputs; sets: of local contacts, by number.

    Margin and surplus are no outputs of the tick: with them the driver follows the measured lateness, so they are taken
    as recorded.
    """
    at = 0
    for k in range(rows.size):
        if rows[k].contact_set != memory[0].near_number:
            while at < sets.size - 1 and sets[at].number < rows[k].contact_set:
                at += 1
            if sets.size and sets[at].number == rows[k].contact_set:
                virtual_tool.take(memory[0], sets[at])
        for i in range(servo.AXES):
            settings[0].margin[i], settings[0].surplus[i] = rows[k].margin[i], rows[k].surplus[i]
        servo.tick(settings[0], memory[0], rows[k])


@kernel
def run_on_counts(settings, memory, rows, tool, counts, start, first, write_delay, command):
    """As loop.run_lockstep, on a device that is where the recorded hand had it: counts (rows, 3) instead of a plant."""
    sample = np.zeros(hardware_interface.SAMPLE)
    period = np.int64(round(settings[0].period * 1e9))
    for k in range(rows.size):
        row, deadline = rows[k], start + k * period
        sample[hardware_interface.LATCHED] = deadline
        sample[hardware_interface.COUNTS : hardware_interface.COUNTS + 3] = counts[k]
        row.tick, row.deadline, row.missed, row.compute = first + k, deadline, 0, 0.0
        row.lateness, row.write_delay, row.command = write_delay * 1e-9, write_delay * 1e-9, command
        fill_inputs(row, settings[0], tool[0], sample, 1)
        fill_contacts(row, memory[0])
        servo.tick(settings[0], memory[0], row)


def snapshot_of(tick, settings, memory):
    """SNAPSHOT array of one, of what this tick (number) has left behind."""
    record = np.zeros(1, SNAPSHOT)
    record["tick"] = tick
    for prefix, part in (("settings", settings), ("memory", memory)):
        for name in part.dtype.names:
            record[f"{prefix}.{name}"] = part[name]
    return record


def parts_of(snapshot):
    """SETTINGS and MEMORY arrays of one, of a SNAPSHOT record. Raises ValueError if its fields are not today's."""
    parts = []
    for prefix, dtype in (("settings", servo.SETTINGS), ("memory", servo.MEMORY)):
        part = np.zeros(1, dtype)
        for name in dtype.names:
            if f"{prefix}.{name}" not in snapshot.dtype.names:
                raise ValueError(f"the snapshots lack {prefix}.{name}: the bag was recorded by another version")
            part[name] = snapshot[f"{prefix}.{name}"].reshape(part[name].shape)  # a bag knows no tables
        parts.append(part)
    return parts
