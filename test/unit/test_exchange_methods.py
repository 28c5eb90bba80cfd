# SPDX-License-Identifier: Apache-2.0
"""Exchange methods as laws: how far a set position goes, and what is believed of a message."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.control import exchange_samples, set_position

STRETCH = st.floats(-0.1, 0.1)


@given(before=STRETCH, wanted=STRETCH, moved=st.floats(-1e-3, 1e-3), reach=st.floats(0.0, 1e-3))
def test_the_set_position_changes_the_stretch_by_no_more_than_the_handle_does_and_the_slew(
    before, wanted, moved, reach
):
    after = set_position.slewed(before, wanted, moved, reach)
    assert abs((after - moved) - before) <= abs(moved) + reach + 1e-15
    if min(0.0, moved) - reach <= wanted - before <= max(0.0, moved) + reach:
        assert after == pytest.approx(wanted, abs=1e-15)


def test_a_free_tool_is_foretold_beside_the_handle_as_far_as_its_agility_lets_it():
    straight = set_position.predicted_position(0.010, 0.1, 0.002, 0.03)
    assert straight == pytest.approx(0.0102)
    assert set_position.predicted_beside_handle(straight, 0.01021, 0.0, 0.002, 20.0, 0.004) == pytest.approx(0.01021)
    assert set_position.predicted_beside_handle(straight, 0.02, 0.0, 0.002, 20.0, 0.004) == pytest.approx(0.0102 + 4e-5)
    assert set_position.predicted_position(0.010, 0.1, 1.0, 0.03) == pytest.approx(0.013)
    for trust, share in ((math.inf, 1.0), (0.002, 0.5), (0.0, 0.0)):  # of its force, half at the age of trust
        beside = set_position.predicted_beside_handle(0.01, 0.01, 1e-5, 0.002, 20.0, trust)
        assert beside == pytest.approx(0.01 - share * 1e-5, abs=1e-12)


def test_of_the_energy_that_a_message_brings_only_what_was_sent_is_believed():
    assert exchange_samples.believed(5.0, 1.0, 3.0, 0.0) == 3.0
    assert exchange_samples.believed(5.0, 1.0, 30.0, 0.0) == 4.0
    assert exchange_samples.believed(1.0, 5.0, 30.0, 0.0) == 0.0
    assert exchange_samples.believed(5.0, 0.0, 3.0, 3.0) == 0.0
