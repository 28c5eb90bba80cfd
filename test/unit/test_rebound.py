# SPDX-License-Identifier: Apache-2.0
"""The largest rebound that gives nothing at the port, against its closed form and the energy of the step itself."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_sim.pymunk_world.rebound import passive_rebound

MASSES, PUSHES = st.floats(0.01, 10.0), st.floats(-0.5, 5.0)


@given(MASSES, st.floats(0.0, 5.0), PUSHES)
def test_of_a_tool_that_does_not_turn_it_is_the_root_of_its_quadratic(mass, more, push):
    """e² (½ + μ) + e (k + μ) = ½."""
    found = rebound(mass, more, push)
    k, mu = push / mass, more
    assert found**2 * (0.5 + mu) + found * (k + mu) == pytest.approx(0.5, abs=1e-9)


@given(MASSES, st.floats(0.0, 5.0), PUSHES, st.floats(0.01, 10.0))
def test_a_step_gains_nothing_just_below_and_something_just_above(mass, more, push, other):
    """The energy of tool, of the body that it strikes and of the port, from the step's own equations; h = u = 1."""
    e = rebound(mass, more, push, other)
    assert gained(mass, more, push, other, 0.999 * e) < 0.0 < gained(mass, more, push, other, 1.001 * e)


def rebound(mass, more, push, other=math.inf):
    """Of a tool of `mass` with the effective mass (1 + more) mass, pushed by an impulse, at the approach 1 m/s."""
    softness, others = 1.0 / (mass * (1.0 + more)), 1.0 / other
    true = mass * softness**2
    loss = push * true * push, true * push, true + others
    return passive_rebound(1.0, softness * push, softness + others, loss)


def gained(mass, more, push, other, e):
    """Energy [J] that comes of a rebound with e, less what the port gives."""
    softness = 1.0 / (mass * (1.0 + more))
    impulse = (1.0 + e + softness * push) / (softness + 1.0 / other)
    after, thrown = 1.0 + softness * (push - impulse), impulse / other
    force = push - mass * more * (after - 1.0)  # at the end of the step
    kept = 0.5 * mass * (after**2 - 1.0) + 0.5 * other * thrown**2
    return kept - force * after
