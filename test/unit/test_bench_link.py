# SPDX-License-Identifier: Apache-2.0
"""The measurement of a link tells what its waits and looks say, and runs against a real device."""

import numpy as np
import pytest
from in_process import bench

from bench import results
from bench.servo import link
from bench.servo.link_rig import Pair


def test_a_ratio_is_the_median_of_the_turns_and_what_came_late_is_counted_apart():
    ours = [np.array([60_000, 60_000, -1, -1]), np.array([90_000] * 4), np.array([10_000] * 4)]
    pair = [np.array([30_000] * 4), np.array([30_000] * 4), np.array([20_000] * 4)]
    found = link.of_turns(zip(ours, pair, strict=True))
    assert found["ours"] == {"p50": 60.0, "p99": 60.0, "late": 0.0}
    assert found["pair"]["p50"] == 30.0
    assert found["p50_ratio"] == found["p99_ratio"] == pytest.approx(2.0)
    assert link.of_turns([(ours[0], pair[0])])["ours"]["late"] == 0.5


def test_where_nothing_came_in_time_there_is_no_ratio():
    found = link.of_turns([(np.array([-1, -1]), np.array([30_000, 30_000]))])
    assert (found["ours"]["p50"], found["ours"]["late"], found["p50_ratio"]) == (None, 1.0, None)


def looks(error_after):
    """Each 10 ms for 6 s: 1 µs off, 200 µs for 0.1 s after the step, then `error_after`(time)."""
    when = np.arange(0.0, 6.0, 0.01)
    error = np.where(when < 3.0, 1.0, np.where(when < 3.1, 200.0, [error_after(one) for one in when]))
    return np.column_stack([when, error, when >= 3.1])


def test_the_clock_is_known_again_when_its_error_stays_small():
    found = link.of_looks(looks(lambda when: -2.0))
    assert found["again"] == pytest.approx(0.1, abs=0.011)
    assert (found["steps"], found["p50"]) == (1, 2.0)
    assert found["p99"] == 2.0
    relapsed = link.of_looks(looks(lambda when: 11.0 if when < 3.5 else 9.0))
    assert relapsed["again"] == pytest.approx(0.5, abs=0.011)


def test_a_clock_that_is_never_known_again_says_so():
    assert link.of_looks(looks(lambda when: 11.0))["again"] is None


def test_an_error_that_comes_later_counts():
    assert link.of_looks(looks(lambda when: 50.0 if when > 5.0 else 1.0))["p99"] == 50.0


@pytest.mark.parametrize("transport", link.TRANSPORTS)
def test_the_bare_pair_has_a_wait_for_each_deadline_and_none_before_it(transport):
    with Pair() as pair:
        waits = pair.waits(transport, 500.0, 100)
    assert waits.shape == (100,)
    assert np.all((waits == -1) | (waits > 0))
    assert np.any(waits > 0)


def test_without_a_compiler_it_says_so_in_one_sentence(monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    done = bench("link", "--rate", "1000", "--seconds", "0.2", "--turns", "1")
    assert done.returncode == 1
    assert "link_pair.c cannot be compiled: " in done.stderr and len(done.stderr.splitlines()) == 1


def test_its_figures_stand_in_the_table(tmp_path):
    (tmp_path / results.MACHINE).write_text("{}")
    waits = {"ours": {"p50": 50.0, "p99": 80.0}, "p50_ratio": 1.5, "p99_ratio": None}
    found = {
        "waits": [{"transport": "udp", "rate": 1000.0} | waits],
        "clock": [{"transport": "pty", "p99": 4.0, "steps": 1, "again": 0.1}],
    }
    shown = list(results.READERS["link"](found))
    assert results.Figure("sample in hand p50 to a bare pair's, udp, 1000 Hz", 1.5, "×", "≤ 2") in shown
    assert results.Figure("sample in hand p99 to a bare pair's, udp, 1000 Hz", None, "×", "≤ 2") in shown
    assert results.Figure("error of the device's clock p99, pty", 4.0, "µs", "≤ 10 µs") in shown
