# SPDX-License-Identifier: Apache-2.0
"""Each option that takes a number refuses what it cannot take in one sentence: name, value, limit, unit."""

import pytest
from in_process import haptic

PASSIVITY = ("passivity", "--stiffness", "1e3", "--damping", "1", "--physical-damping", "3", "--period", "1e-3")
LIMITED = [
    (("demo",), "--seconds", "s", 0.5, 3600.0),
    (("demo",), "--delay", "ms", 0.0, 2000.0),
    (("demo",), "--jitter", "ms", 0.0, 2000.0),
    (("demo",), "--loss", "", 0.0, 1.0),
    (("demo",), "--rate", "Hz", 500.0, 10000.0),
    (("demo",), "--port", "", 0, 65535),
    (("view",), "--port", "", 0, 65535),
    (("doctor",), "--seconds", "s", 0.2, 60.0),
    (("record",), "--seconds", "s", 0.1, 1e7),
    (("record",), "--split-size", "MB", 0.0, 1e6),
    (("record",), "--split-duration", "s", 0.0, 1e6),
    (("status",), "--domain", "", 0, 232),
]
JUDGED = ("stiffness", "damping", "physical-damping", "period", "mass", "velocity-lag", "resolution", "coulomb")


def refused(*words):
    done = haptic(*words)
    assert done.returncode == 2 and done.stdout == "" and len(done.stderr.strip().splitlines()) == 1, done
    return done.stderr.strip()


@pytest.mark.parametrize(("words", "option", "unit", "low", "high"), LIMITED)
def test_a_number_beyond_its_limits_is_refused_with_limit_and_unit(words, option, unit, low, high):
    def amount(value):
        return f"{value!r} {unit}".rstrip()

    kind = type(low)
    least, most = kind(low - 1), kind(high * 2)
    assert refused(*words, option, least) == f"haptic: {option} is {amount(least)}; at least {amount(low)} is needed"
    assert refused(*words, option, most) == f"haptic: {option} is {amount(most)}; at most {amount(high)} is allowed"


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
@pytest.mark.parametrize(("words", "option", "unit", "low", "high"), LIMITED)
def test_what_is_no_finite_number_is_refused_with_the_unit(words, option, unit, low, high, value):
    wanted = f"{'a finite' if isinstance(low, float) else 'a whole'} number{f' in {unit}' if unit else ''}"
    given = value if isinstance(low, float) else repr(value)
    assert refused(*words, option, value) == f"haptic: {option} is {given}; {wanted} is needed"


@pytest.mark.parametrize(("words", "option", "unit", "low", "high"), LIMITED)
def test_a_word_for_a_number_is_refused_with_the_unit(words, option, unit, low, high):
    wanted = f"{'a' if isinstance(low, float) else 'a whole'} number{f' in {unit}' if unit else ''}"
    assert refused(*words, option, "soon") == f"haptic: {option} is 'soon'; {wanted} is needed"


@pytest.mark.parametrize("option", JUDGED)
@pytest.mark.parametrize("value", ["nan", "inf", "soon"])
def test_passivity_refuses_what_is_no_finite_number(option, value):
    assert f"{value!r}" in (said := refused(*PASSIVITY, f"--{option}", value)) or f"is {value}" in said
    assert option in said or option.replace("-", "_") in said
