# SPDX-License-Identifier: Apache-2.0
"""A diagnostic status as this project reads it, live and out of a bag; anybody's, whatever is in it."""

import math
import sys
from collections.abc import Iterable
from typing import Any, NamedTuple

LEVELS = ("OK", "WARN", "ERROR", "STALE")


class Status(NamedTuple):
    """One diagnostic status of a node.

    Attributes:
        time: when it was received, of the system clock [ns].
        level: place in LEVELS: OK, WARN, ERROR, STALE.
        message: its sentence.
        values: its entries, {name: text}.
        hardware: name of the device.

    Examples:
        >>> from haptic_device.recording import load
        >>> status = load("run/bag").statuses("haptic_driver")[-1]
        >>> status.level, status.values["physical_damping"]  # b of x, y, theta
        (0, '3, 3, 0.004')
    """

    time: int
    level: int
    message: str
    values: dict[str, str]
    hardware: str = ""


def named_statuses(message: Any, time: int) -> list[tuple[str, Status]]:
    """(name, status) of each entry of a DiagnosticArray of rclpy or rosbags, received at time [ns, system clock].

    A level beyond LEVELS is taken for STALE.
    """
    return [(said.name, _status(said, time)) for said in message.status]


def of_namespace(statuses: Iterable[Status], namespace: str) -> bool:
    """Whether the statuses of one message are of a node in this namespace, or of one that does not say where it is."""
    own = namespace.rstrip("/")
    return all(one.values.get("namespace", own).rstrip("/") == own for one in statuses)


def _status(said: Any, time: int) -> Status:
    values = {sys.intern(pair.key): pair.value for pair in said.values}  # the same few in thousands of messages
    level = said.level[0] if isinstance(said.level, bytes) else int(said.level)
    return Status(time, min(level, len(LEVELS) - 1), said.message, values, said.hardware_id)


def number(text: str) -> float:
    """What a value of a status says; NaN where that is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan
