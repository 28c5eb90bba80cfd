# SPDX-License-Identifier: Apache-2.0
"""A search for contacts in three axes, by a kernel of its own, that draw energy from the tool in the servo."""

import pytest
from exchange_systems import three_axes

from adversary import contact_search

BUDGET = 0.005  # [J]


@pytest.mark.parametrize("seed, loss", [(1, 0.0), (2, 0.3)])
def test_no_contacts_in_three_axes_draw_more_than_the_budget_or_fool_the_books(seed, loss):
    found = contact_search.search(three_axes("local"), 100, 150, loss, seed)
    assert found.energy <= BUDGET and found.overcredit <= 1e-9 and found.moved > 1000
