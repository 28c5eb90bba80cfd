# SPDX-License-Identifier: Apache-2.0
"""The walks of a wall and of a contact through the code."""

import re

import pytest
from in_process import bench

from bench import walks


def test_the_walks_have_all_their_hops_and_the_page_names_their_files():
    told = bench("walks")
    page = (walks.ROOT / "docs/theory/architecture.md").read_text(encoding="utf-8")
    for walk in re.split(r"\n(?=a )", told.stdout.strip()):
        head, *lines = walk.splitlines()
        table = page.partition(f"### A{head[1:]}\n")[2].partition("\n#")[0]
        assert re.findall(r"^\| `(\S+)` \|", table, re.MULTILINE) == [line.partition(":")[0] for line in lines]
    assert told.returncode == 0


@pytest.mark.parametrize(
    "chain, sentence",
    [
        ("gain_check:judge > control/passivity:weights", "no hop from judge to control/passivity:weights"),
        ("gain_check:judge > gone", "gain_check:gone is in 0 files"),
        ("gain_check:judge\nmotor:command", "no hop from what comes before to motor:command"),
    ],
)
def test_a_hop_that_the_code_has_no_more_is_a_sentence_that_names_it(chain, sentence):
    with pytest.raises(ValueError, match=sentence):
        walks.walk(chain)
