# SPDX-License-Identifier: Apache-2.0
"""How often a property is tried: seldom in every run, MANY times as often in `make soak`."""

from hypothesis import settings

MANY = 20


def searching():
    """Whether hypothesis' profile is to search: it alone draws at random."""
    return not settings.default.derandomize


def tries(count):
    """So many, or MANY times as many where searching."""
    return count * MANY if searching() else count


def few(count, **more):
    """Settings for so many examples."""
    return settings(max_examples=tries(count), deadline=None, **more)
