# SPDX-License-Identifier: Apache-2.0
"""How often a property is tried: seldom in every run, MANY times as often in `make soak`."""

from hypothesis import settings

MANY = 20


def tries(count):
    """So many, or MANY times as many where hypothesis' profile is to search: it alone draws at random."""
    return count if settings.default.derandomize else count * MANY


def few(count, **more):
    """Settings for so many examples."""
    return settings(max_examples=tries(count), deadline=None, **more)
