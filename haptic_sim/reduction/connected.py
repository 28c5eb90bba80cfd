# SPDX-License-Identifier: Apache-2.0
"""Which things hang together. As scipy's connected_components, whose import takes longer than a scene to be reduced."""

from collections.abc import Hashable, Iterable, Sequence
from typing import TypeVar

Thing = TypeVar("Thing", bound=Hashable)


def connected(things: Iterable[Thing], links: Iterable[Sequence[Thing]]) -> list[list[Thing]]:
    """Groups of things that links between two connect; groups by their first, and in each, in the order of the things.

    A link to what is not among the things is none.
    """
    groups = {thing: [thing] for thing in things}
    for one, other in links:
        if one in groups and other in groups and groups[one] is not groups[other]:
            joined = groups[one] + groups[other]
            groups |= dict.fromkeys(joined, joined)
    found: dict[int, list[Thing]] = {}
    for thing, group in groups.items():
        found.setdefault(id(group), []).append(thing)
    return list(found.values())
