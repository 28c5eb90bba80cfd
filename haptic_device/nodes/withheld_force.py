# SPDX-License-Identifier: Apache-2.0
"""What the driver says of force that it withholds: the causes that stand, in a sentence with their numbers."""

import math

import numpy as np

from haptic_device.control.withheld import TABLE

WORD = "force withheld"
LEAST_ANGLE = 1.0  # [°] below which a tool is not said to be turned


def sentence(standing, row):
    """The word, and of the first cause time, number and cure; "" where none stands.

    standing: {name: time [s]} in the order of the table (withheld_time); row: the newest of the servo.
    """
    if not standing:
        return ""
    cause = next(each for each in TABLE if each.name in standing)
    number = cause.number.format_map(numbers(row))
    told = "; ".join(part for part in (cause.cause, number, cause.cure) if part)
    others = "".join(f"; also {name}" for name in standing if name != cause.name)
    return f"{WORD} for {standing[cause.name]:.1f} s ({cause.name}): {told}{others}"


def numbers(row):
    """What the table's numbers are: forces [N, N m], the distance in words, age [ms], shares [%], energy [mJ]."""
    wanted = row.force_walls + row.force_coupling
    return {
        "force": math.hypot(wanted[0], wanted[1]),
        "torque": abs(float(wanted[2])),
        "walls": float(np.hypot(*row.force_walls[:2])),
        "motor": float(np.hypot(*row.force_on_handle[:2])),
        "twist": abs(float(row.force_on_handle[2])),
        "apart": _apart(row),
        "age": row.tool_age * 1e3,
        "fade": row.exchange_fade * 100.0,
        "tank": row.exchange_tank * 1e3,
        "ramp": row.engage * 100.0,
    }


def _apart(row):
    """How far the tool is from the handle, and turned where it is."""
    away = row.tool_position - row.position
    told = f"{math.hypot(away[0], away[1]) * 1e3:.3g} mm"
    angle = abs(math.degrees(away[2]))
    return told + (f" and {angle:.3g}°" if angle > LEAST_ANGLE else "")
