# SPDX-License-Identifier: Apache-2.0
"""Errors fall with the step at the order that each method claims."""

import pytest

from bench.methods.orders import PROBLEMS, errors, order, steps_of

CLAIMED = [(problem, method) for problem, of in PROBLEMS.items() for method in of.orders]


@pytest.mark.parametrize(("problem", "method"), CLAIMED)
def test_errors_fall_with_the_step_at_the_order_of_the_method(problem, method):
    """First order from both sides; a high one may be exceeded while errors of lower order are out of sight."""
    claimed, found = PROBLEMS[problem].orders[method], errors(problem, method)
    slope = order(steps_of(problem, method), found)
    assert slope > 0.85 * claimed
    assert slope < (1.2 if claimed == 1 else 1.3 * claimed)


def test_an_error_that_halves_with_the_step_has_order_one_and_one_that_stays_has_none():
    assert order((1.0, 0.5, 0.25), (4.0, 2.0, 1.0)) == pytest.approx(1.0)
    assert order((1.0, 0.5, 0.25), (4.0, 4.0, 4.0)) == pytest.approx(0.0, abs=1e-12)
