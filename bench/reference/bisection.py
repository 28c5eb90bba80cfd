# SPDX-License-Identifier: Apache-2.0
"""The bound between what is enough and what is not, by halving."""

from collections.abc import Callable


def bisected(enough: Callable[[float], bool], low: float, high: float, halvings: int) -> float:
    """The least value between `low` and `high` that is enough, the middle of what so many halvings leave."""
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if enough(middle) else (middle, high)
    return 0.5 * (low + high)
