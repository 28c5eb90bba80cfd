# SPDX-License-Identifier: Apache-2.0
"""Messages that never came, by the publishers' numbers: one by one as a bag is repaired, at once as it is read."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.recording.sequence_gaps import UNKNOWN, SequenceGaps, counted


def one_by_one(sequences):
    skipped = SequenceGaps()
    for sequence in sequences:
        skipped.count(sequence)
    return skipped


@given(st.lists(st.integers(0, 12), min_size=1))
def test_reading_at_once_counts_as_one_by_one(sequences):
    assert counted(np.array(sequences, np.int64)) == one_by_one(sequences)


@pytest.mark.parametrize(
    ("topic", "sequences", "told"),
    [
        ("/haptic/tool", (3, 4, 7), "2"),
        ("/haptic/tool", (8, 9, 2, 4), "1"),  # a publisher that started anew
        ("/haptic/tool", (8, 2, 9, 3), UNKNOWN),
        ("/haptic/tool", (0, 0, 0), "0"),  # no numbers at all
        ("/diagnostics", (1, 2, 3), "0"),
        ("/diagnostics", (1, 5), UNKNOWN),
        ("/haptic/mark", (1, 2, 1, 4), UNKNOWN),
    ],
)
def test_a_gap_counts_unless_it_may_be_another_publishers(topic, sequences, told):
    assert one_by_one(sequences).told(topic) == told
