# SPDX-License-Identifier: Apache-2.0
"""The walks of a wall and of a contact through the code."""

import re

import pytest
from in_process import bench

from bench import walks


def test_the_walks_have_all_their_hops_and_pass_no_more_files_than_they_do():
    told = bench("walks")
    counts = [int(count) for count in re.findall(r"^a .*: (\d+) files$", told.stdout, re.MULTILINE)]
    assert told.returncode == 0 and len(counts) == 2 and counts[0] <= 22 and counts[1] <= 23


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
