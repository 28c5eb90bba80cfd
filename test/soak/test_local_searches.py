# SPDX-License-Identifier: Apache-2.0
"""Long searches for messages and contacts that draw energy from the tool in the servo, or fool its books."""

import pytest
from exchange_systems import one_axis, three_axes

from haptic_device.analysis import contact_search
from haptic_device.analysis import exchange_search as adversary

BUDGET = 0.005  # [J]


@pytest.mark.parametrize("seed, loss, limit", [(1, 0.0, 20.0), (2, 0.3, 20.0), (3, 0.3, 2.0)])
def test_no_message_draws_more_than_the_budget(seed, loss, limit):
    found = adversary.search(one_axis("local", force__limit=limit), adversary.Adversary(loss=loss), 150, 400, seed)
    assert found.energy <= BUDGET


def test_the_books_never_credit_what_contacts_said_beyond_the_truth():
    found = adversary.search(one_axis("local"), adversary.Adversary(books=1), 150, 400, 5)
    assert found.overcredit <= 1e-9


@pytest.mark.parametrize("seed, loss", [(1, 0.0), (2, 0.3)])
def test_no_contacts_in_three_axes_draw_more_than_the_budget_or_fool_the_books(seed, loss):
    found = contact_search.search(three_axes("local"), 100, 150, loss, seed)
    assert found.energy <= BUDGET and found.overcredit <= 1e-9 and found.moved > 1000
