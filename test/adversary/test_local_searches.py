# SPDX-License-Identifier: Apache-2.0
"""A search for contacts in three axes, by a kernel of its own, that draw energy from the tool in the servo."""

import subprocess
import sys
from pathlib import Path

import pytest
from exchange_systems import three_axes

from adversary import contact_search

BUDGET = 0.005  # [J]


@pytest.mark.parametrize("seed, loss", [(1, 0.0), (2, 0.3)])
def test_no_contacts_in_three_axes_draw_more_than_the_budget_or_fool_the_books(seed, loss):
    found = contact_search.search(three_axes("local"), 100, 150, loss, seed)
    assert found.energy <= BUDGET and found.overcredit <= 1e-9 and found.moved > 1000


@pytest.mark.parametrize("name", ["contacts.py", "exchange.py"])
def test_the_searches_that_the_documents_name_print_at_most_the_budget_in_each_row(name):
    command = [sys.executable, str(Path(__file__).with_name(name)), "20"]
    shown = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n\n")[0]
    head, *searched = shown.splitlines()[1:]
    column = slice(head.index("given mJ") - 4, head.index("given mJ") + len("given mJ"))
    given = [float(row[column]) for row in searched if row[column].strip()]
    assert len(given) >= 8 and max(given) <= 1e3 * BUDGET
