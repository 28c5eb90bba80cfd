# SPDX-License-Identifier: Apache-2.0
"""How numbers are written in a report."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.analysis.report.digits import UNKNOWN, amount, plain, with_error

NUMBERS = st.floats(-1e9, 1e9)


@pytest.mark.parametrize(
    ("value", "error", "told"),
    [
        (-1.045, 7.2, "−1 ± 7 N/m"),
        (1999.6, 12.3, "2000 ± 12 N/m"),
        (2.0413, 0.0194, "2.041 ± 0.019 N/m"),
        (2.0413, 0.0196, "2.04 ± 0.02 N/m"),
        (2.0413, 0.0961, "2.04 ± 0.10 N/m"),
        (1234.0, 320.0, "1200 ± 300 N/m"),
        (-0.2, 3.0, "0 ± 3 N/m"),
        (1.5, 0.0, "1.5 ± 0 N/m"),
        (1.5, math.nan, "1.5 ± — N/m"),
        (math.nan, 1.0, "— ± 1 N/m"),
    ],
)
def test_a_value_has_no_digit_beyond_its_error(value, error, told):
    assert with_error(value, error, "N/m") == told


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (25.730, "25.7 N"),
        (0.99949, "999 mN"),
        (0.9996, "1 N"),
        (1e-3, "1 mN"),
        (-4.2e-5, "−42 µN"),
        (1e-9, "1 nN"),
        (0.99e-9, "under 1 nN"),
        (9.78e-13, "under 1 nN"),
        (12345.6, "12346 N"),
        (0.0, "0 N"),
        (math.nan, UNKNOWN),
        (-math.inf, UNKNOWN),
    ],
)
def test_an_amount_has_the_prefix_that_suits_it(value, told):
    assert amount(value, "N") == told


@pytest.mark.parametrize(
    ("value", "told"), [(999.4, "999"), (999.6, "1000"), (0.012345, "0.0123"), (-1.5, "−1.5"), (0.0, "0"), (8.0, "8")]
)
def test_a_plain_number_has_up_to_three_digits(value, told):
    assert plain(value) == told


@given(NUMBERS, st.floats(1e-6, 1e6))
def test_what_is_written_is_the_value_within_half_its_error_and_has_no_hyphen(value, error):
    text = with_error(value, error)
    assert "-" not in text and "e" not in text
    told, _, told_error = text.replace("−", "-").partition(" ± ")
    assert abs(float(told) - value) <= 0.51 * error + 1e-9 * abs(value)
    assert abs(float(told_error) - error) <= 0.26 * error


@given(NUMBERS)
def test_a_number_of_three_digits_is_right_to_half_a_percent(value):
    text = plain(value).replace("−", "-")
    assert abs(float(text) - value) <= 0.005 * abs(value) + 1e-300
