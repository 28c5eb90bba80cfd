# SPDX-License-Identifier: Apache-2.0
"""Sections of a ROS 2 parameter file and the nodes that they reach. Needs no library: the launch file has none."""

import re
from collections.abc import Iterator
from typing import Any

SECTION = "ros__parameters"


def outside(document: dict[str, Any], path: str = "") -> Iterator[tuple[str, str, object]]:
    """Keys that stand in no ros__parameters, with what they hold: (key of the node above, name, content)."""
    for name, content in document.items():
        yield path, name, content
        if name != SECTION and isinstance(content, dict):
            yield from outside(content, f"{path}/{name}" if path else name)


def sections(document: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """(node key, {dotted name: value}) for each ros__parameters in the file, in the order of the file."""
    found = outside(document)
    return [(path, dict(_flat(held))) for path, name, held in found if name == SECTION and isinstance(held, dict)]


def given_to(name: str, found: list[tuple[str, dict[str, Any]]]) -> dict[str, Any]:
    """What these sections give the node of this full name; later ones win, as in ROS 2."""
    return dict(item for key, section in found if reaches(key, name) for item in section.items())


def reaches(key: str, name: str) -> bool:
    """Whether a section with this key is for the node of this full name: * is one level, ** any number of them."""
    levels = {"**": r"(/\w+)*", "*": r"/\w+"}
    pattern = "".join(levels.get(level, "/" + re.escape(level)) for level in key.strip("/").split("/"))
    return re.fullmatch(pattern, name) is not None


def _flat(mapping: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, content in mapping.items():
        if isinstance(content, dict):
            yield from _flat(content, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", content
