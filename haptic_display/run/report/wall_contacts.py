# SPDX-License-Identifier: Apache-2.0
"""When the handle or the tool touched something, read from the trace."""

from typing import NamedTuple

import numpy as np

from haptic_device.recording.bag_contents import Records
from haptic_device.theory.quantity import Array, Flags

SHORTEST_GAP = 0.02  # [s]; a contact that comes back sooner is the same one
SHORTEST = 0.005  # [s]


class Contact(NamedTuple):
    """One contact.

    Attributes:
        begin: when it began [s].
        end: when it ended [s].
        force: largest force on the hand during the contact [N].

    Examples:
        >>> from haptic_display.run.report.reading import read_run
        >>> contact = read_run("run/bag").contacts[0]
        >>> contact.begin < contact.end
        True
    """

    begin: float
    end: float
    force: float


def touching(rows: Records) -> Flags:
    """Whether each tick was in contact, (ticks): the tool with the scene, or the handle with a wall of the servo.

    Args:
        rows: of a trace.

    Examples:
        >>> from haptic_display.run.report.wall_contacts import touching
        >>> from haptic_device.recording import load
        >>> touch = touching(load("run/bag").trace)
        >>> bool(touch[0]), bool(touch[-1])  # free at first, in the wall at the end
        (False, True)
    """
    there = [name for name in ("tool_contact", "force_walls") if name in (rows.dtype.names or ())]
    touch = np.zeros(len(rows), bool)
    for name in there:
        column = rows[name]
        touch |= (column if column.ndim == 1 else np.abs(column).max(axis=1)) > 0.0
    return touch


def contacts(seconds: Array, touch: Flags, force: Array) -> list[Contact]:
    """Contacts in order of time. Gaps below 20 ms are ignored, and so are contacts shorter than 5 ms.

    Args:
        seconds: time of each tick [s], (n).
        touch: from `touching`, (n).
        force: on the handle in x and y [N], (n, 2).

    Examples:
        >>> import numpy as np
        >>> from haptic_display.run.report.wall_contacts import contacts
        >>> seconds = np.arange(0.0, 1.0, 0.001)
        >>> touch = (seconds > 0.2) & (seconds < 0.5)
        >>> force = np.outer(touch, [3.0, 4.0])
        >>> [(round(one.begin, 3), round(one.end, 3), one.force) for one in contacts(seconds, touch, force)]
        [(0.201, 0.499, 5.0)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], touch, [False]]).astype(np.int8)))
    joined: list[list[int]] = []
    for begin, end in edges.reshape(-1, 2):
        if joined and seconds[begin] - seconds[joined[-1][1] - 1] < SHORTEST_GAP:
            joined[-1][1] = end
        else:
            joined.append([begin, end])
    return [
        Contact(float(seconds[begin]), float(seconds[end - 1]), _largest(force[begin:end]))
        for begin, end in joined
        if seconds[end - 1] - seconds[begin] >= SHORTEST
    ]


def _largest(force: Array) -> float:
    sizes = np.hypot(force[:, 0], force[:, 1])
    sizes = sizes[np.isfinite(sizes)]
    return float(sizes.max()) if len(sizes) else float("nan")
