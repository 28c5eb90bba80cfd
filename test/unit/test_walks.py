# SPDX-License-Identifier: Apache-2.0
"""The walks of a wall and of a contact through the code."""

import re

import pytest
from in_process import bench

from bench import walks


def test_the_walks_have_all_their_hops_and_the_page_names_their_files():
    told = bench("walks")
    page = " ".join((walks.ROOT / "docs/theory/architecture.md").read_text().split())
    for walk in re.split(r"\n(?=a )", told.stdout.strip()):
        head, *lines = walk.splitlines()
        files = ", ".join(f"`{line.partition('.py:')[0].rpartition('/')[2]}`" for line in lines)
        assert f"{head[1:]}. {files}." in page
    assert told.returncode == 0


@pytest.mark.parametrize(
    "chain, sentence",
    [
        ("gain_check:judge > control/passivity:least_damping", "no hop from judge to control/passivity:least_damping"),
        ("gain_check:judge > gone", "gain_check:gone is in 0 files"),
        ("gain_check:judge\nmotor:command", "no hop from what comes before to motor:command"),
    ],
)
def test_a_hop_that_the_code_has_no_more_is_a_sentence_that_names_it(chain, sentence):
    with pytest.raises(ValueError, match=sentence):
        walks.walk(chain)
