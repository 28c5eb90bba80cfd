# SPDX-License-Identifier: Apache-2.0
"""Benchmarks that run by the clock, and one as a process of its own."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import psutil

from haptic_sim.supervision import lateness

ROOT = Path(__file__).parents[2]


def test_the_servo_alone_ticks_at_whole_periods_and_counts_what_it_missed():
    late, rows = lateness.alone(1000.0, 0.3, "off")
    steps = np.diff(rows["deadline"])
    assert np.all(steps % 1_000_000 == 0)
    assert late.missed == np.sum(steps // 1_000_000 - 1)
    assert len(late.sorted_us) == len(rows) > 0 and late.sorted_us[0] >= 0.0


def test_a_benchmark_ends_with_the_command_that_runs_all_of_them(start, tmp_path):
    words = ["all", "--only", "servo", "--out", tmp_path / "kept"]
    process = start([sys.executable, "-m", "bench", *words], cwd=ROOT, stderr=subprocess.PIPE)
    assert "python -m bench servo" in process.stderr.readline() and "1000 Hz" in process.stderr.readline()
    [one] = psutil.Process(process.pid).children()
    process.terminate()
    assert psutil.wait_procs([one], timeout=60.0)[1] == []  # a limit; nobody would end it otherwise
