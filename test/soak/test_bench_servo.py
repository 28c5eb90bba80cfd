# SPDX-License-Identifier: Apache-2.0
"""Measurements against the clock run, and hard cases that a method does not survive are told by their letters."""

import numpy as np
import pytest
from in_process import bench

from bench.methods import hard_cases
from bench.servo import cyclictest, link
from bench.servo.link_rig import Pair


@pytest.mark.parametrize("transport", link.TRANSPORTS)
def test_the_bare_pair_of_a_link_has_a_wait_for_each_deadline_and_none_before_it(transport):
    with Pair() as pair:
        waits = pair.waits(transport, 500.0, 100)
    assert waits.shape == (100,)
    assert np.all((waits == -1) | (waits > 0))
    assert np.any(waits > 0)


def test_without_cyclictest_the_servo_is_measured_alone_and_that_is_said(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    done = bench("servo", "--rate", "1000", "--seconds", "0.2", "--turns", "1")
    assert done.returncode == 0, done.stderr
    assert cyclictest.MISSING in done.stderr
    assert "| 1000 | prefer |" in done.stdout


def test_what_does_not_survive_a_hard_case_is_told_by_its_letter():
    """Where section 5 of the paper says it: a light block under a heavy one; and a shot through a thin plate."""
    assert "N" in hard_cases.verdict("heavy_on_light_1e6", "penalty_explicit", 1).letters
    assert "T" in hard_cases.verdict("thin_plate", "pymunk", 2).letters
    survivor = hard_cases.verdict("heavy_on_light_1e6", "partitioned", 2)
    assert (survivor.letters, survivor.survives, survivor.tried) == ("", True, 2)
