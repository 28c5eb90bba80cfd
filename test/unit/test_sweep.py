# SPDX-License-Identifier: Apache-2.0
"""Sweeps on threads and processes: the same numbers, kept where they were torn off; no cluster is a sentence."""

import sys
from typing import NamedTuple

import numpy as np
import pytest

from bench.jobs import Kept
from bench.jobs import sweep as run_jobs
from haptic_device.theory import sweep


def test_what_is_no_address_of_a_scheduler_is_refused_before_anything_is_tried():
    pytest.importorskip("distributed")
    for address in ("nonsense", "127.0.0.1", "http://127.0.0.1:8786", "tcp://127.0.0.1"):
        with pytest.raises(ValueError, match="must be an address such as tcp://host:8786"):
            next(sweep.spread(len, {"job": ("",)}, 1, address))


def test_without_dask_the_option_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match="pip install"):
        next(sweep.spread(len, {"job": ("",)}, 1, "tcp://127.0.0.1:8786"))


class Row(NamedTuple):
    number: int
    value: float


def row(k):
    return Row(k, k + 1.0 / 3.0 if k else np.inf)


def kept_in(path):
    return Kept(path, Row, lambda row: (row.number,))


@pytest.mark.parametrize("whole", [0, 2])
def test_a_kept_sweep_goes_on_where_it_was_torn_off_and_numbers_come_back_to_the_bit(tmp_path, whole):
    file, jobs = tmp_path / "kept.csv", {(k,): (k,) for k in range(4)}
    run_jobs(row, dict(list(jobs.items())[: whole or 1]), kept_in(file), 1)
    lines = file.read_text().splitlines(keepends=True)[: 1 + whole]
    file.write_text("".join(lines) + "2,2.3")
    kept, asked = kept_in(file), []
    run_jobs(lambda k: asked.append(k) or row(k), jobs, kept, 1)
    assert asked == list(range(whole, 4))
    assert kept_in(file).known == {(k,): row(k) for k in range(4)}
