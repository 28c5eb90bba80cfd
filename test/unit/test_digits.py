# SPDX-License-Identifier: Apache-2.0
"""How numbers are written for people: in reports, tables and sentences."""

import math

from hypothesis import given
from hypothesis import strategies as st

from haptic_device.digits import UNKNOWN, amount, apart, plain, with_error

NUMBERS = st.floats(-1e9, 1e9)


def test_a_value_has_no_digit_beyond_its_error():
    for value, error, told in (
        (-1.045, 7.2, "−1 ± 7 N/m"),
        (1999.6, 12.3, "2000 ± 12 N/m"),
        (2.0413, 0.0194, "2.041 ± 0.019 N/m"),
        (2.0413, 0.0196, "2.04 ± 0.02 N/m"),
        (2.0413, 0.0961, "2.04 ± 0.10 N/m"),
        (-0.2, 3.0, "0 ± 3 N/m"),
        (1.5, 0.0, "1.5 ± 0 N/m"),
        (1.5, math.nan, "1.5 ± — N/m"),
        (math.nan, 1.0, "— ± 1 N/m"),
        (1.6234, None, "1.62 N/m"),
    ):
        assert with_error(value, error, "N/m") == told


def test_an_amount_has_the_prefix_that_suits_it_if_its_unit_has_any_and_a_count_is_as_it_is():
    for value, unit, told in (
        (25.730, "N", "25.7 N"),
        (0.99949, "N", "999 mN"),
        (0.9996, "N", "1 N"),
        (-4.2e-5, "N", "−42 µN"),
        (1e-9, "N", "1 nN"),
        (0.99e-9, "N", "under 1 nN"),
        (12345.6, "N", "12346 N"),
        (0.0, "N", "0 N"),
        (math.nan, "N", UNKNOWN),
        (-math.inf, "N", UNKNOWN),
        (0.05, "N s/m", "0.05 N s/m"),
        (1e-9, "rad", "0.000000001 rad"),
        (0.99e-9, "rad", "0 rad"),
        (1234567, "", "1234567"),
        (0.0123456, "m/s", "12.3 mm/s"),
    ):
        assert amount(value, unit) == told


def test_a_plain_number_has_three_digits_or_as_many_as_are_asked_for():
    for value, told in ((999.4, "999"), (999.6, "1000"), (0.012345, "0.0123"), (-1.5, "−1.5"), (0.0, "0")):
        assert plain(value) == told
    for digits, told in ((2, "10"), (4, "9.996"), (6, "9.99608")):
        assert plain(9.99608, digits=digits) == told


def test_what_is_beyond_a_limit_is_told_with_enough_digits_to_see_that():
    for value, limit, told in (
        (3.2, 3.0, ("3.2", "3")),
        (3.0004, 3.0, ("3.0004", "3")),
        (0.1 + 0.2, 0.3, ("0.3", "0.3")),
        (-0.12001, -0.12, ("−0.12001", "−0.12")),
        (math.inf, 1.0, (UNKNOWN, "1")),
    ):
        assert apart(value, limit) == told


@given(st.floats(1e-6, 1e6), st.floats(1e-9, 1e3))
def test_two_numbers_told_apart_are_in_their_order(value, beyond):
    more, less = map(float, apart(value * (1.0 + beyond), value))
    assert more > less


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
