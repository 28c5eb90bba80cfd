# SPDX-License-Identifier: Apache-2.0
"""A parameter file that a page sends: what of it can be set now, and what has to wait for the nodes to start again."""

from collections.abc import Iterator
from pathlib import PurePath
from typing import Any, NamedTuple

from haptic_device.config.parameter_files import PLACES, Values, operating_point_problems, right_values
from haptic_device.config.parameter_types import defaults
from haptic_device.config.yaml_reader import loads
from haptic_display.page import settings
from haptic_sim.node.parameters import NODES

LARGEST = 65536  # bytes of a file
NAMED = 4  # changes that are told by name


class Point(NamedTuple):
    """What a file asks for: all live values of the driver, the names of those that it changes, and the names of others
    that differ from what runs."""

    live: dict[str, Any]
    changed: list[str]
    waiting: list[str]

    @property
    def sentence(self) -> str:
        """For whoever sent the file, once the live values are set."""
        changed = f"it changed {_some(self.changed)}" if self.changed else "it changed nothing"
        waiting = f"; only a start of the nodes with this file sets {', '.join(self.waiting)}" if self.waiting else ""
        return f"the file is loaded: {changed}{waiting}"


def point_in(file: bytes, namespace: str, running: Values) -> Point:
    """What a file asks of the nodes in this namespace; running: {node: {name: value}}. A live parameter that the file
    does not name has its default. Raises ValueError, one sentence."""
    if len(file) > LARGEST:
        raise ValueError(f"the file has more than {LARGEST // 1024} kB")
    document = loads(file, ros=True)
    if wrong := list(operating_point_problems(document, NODES)):
        raise ValueError(wrong[0] + (f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""))
    given, _ = right_values(document, settings.NODES, namespace)
    if not any(given.values()):
        raise ValueError(f"the file has no ros__parameters for a node in {namespace}")
    live = defaults(settings.LIVE.values()) | {
        name: value for name, value in given[settings.DRIVER].items() if name in settings.LIVE
    }
    now = running.get(settings.DRIVER, {})
    changed = [name for name, value in live.items() if name in now and not _same(name, value, now[name])]
    return Point(live, changed, list(dict.fromkeys(_waiting(given, running))))


def _some(names: list[str]) -> str:
    return ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")


def _waiting(given: Values, running: Values) -> Iterator[str]:
    for node, values in given.items():
        for name, value in values.items():
            live = node == settings.DRIVER and name in settings.LIVE
            known = running.get(node, {})
            if not live and name in known and not _same(name, value, known[name]):
                yield name


def _same(name: str, one: Any, other: Any) -> bool:
    """A file may be named by its path or by its name among the package's own."""
    if name in PLACES:
        one, other = (PurePath(path).name.removesuffix(".yaml") for path in (one, other))
    return one == other
