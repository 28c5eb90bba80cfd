# SPDX-License-Identifier: Apache-2.0
"""How often a property is tried: seldom in every run, MANY times as often in `make soak`."""

import itertools

import pytest
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


def half(names, *values):
    """Parameters of a test: of all combinations every second, all where searching. With three parameters or
    more each value still meets each value of any other."""
    places = itertools.product(*(range(len(of)) for of in values))
    taken = [place for place in places if searching() or sum(place) % 2 == 0]
    return pytest.mark.parametrize(
        [name.strip() for name in names.split(",")],
        [[of[k] for of, k in zip(values, place, strict=True)] for place in taken],
    )
