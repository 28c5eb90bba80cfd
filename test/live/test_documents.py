# SPDX-License-Identifier: Apache-2.0
"""Start and the tutorials: every block does what its page says."""

from pathlib import Path

import pytest
import tutorials

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [DOCS / "start.md", *sorted(DOCS.glob("tutorials/*.md"))]


@pytest.mark.timeout(300)
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_block_of_the_page_does_what_the_page_says(page, ros_domain, tmp_path):
    tutorials.run(page.read_text(encoding="utf-8"), tmp_path, ros_domain)
