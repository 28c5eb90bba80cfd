# SPDX-License-Identifier: Apache-2.0
"""The twins in C that kernels are timed beside are the same law."""

import numpy as np
import pytest

from haptic_device.law import servo as law
from haptic_sim.bench import c_twin
from haptic_sim.cli import bench_servo


@pytest.fixture
def compiler():
    """A C compiler, or else Python itself in its place: then there is nothing to run."""
    return c_twin.compiler()


def test_the_tick_in_c_writes_the_same_rows_to_the_last_bit(compiler, tmp_path):
    if compiler is None:
        assert bench_servo.twins(1) is None
        return
    twin = c_twin.TickTwin(tmp_path, 2000)
    twin.kernel()
    ours = twin.rows
    twin.c()
    for name in law.TICK.names:
        np.testing.assert_array_equal(ours[name], twin.rows[name], name)
    assert ours["engage"][-1] == 1.0 and np.ptp(ours["force_coupling"]) > 0.0


def test_a_cell_in_c_comes_to_the_same_outcome(compiler, tmp_path):
    if compiler is None:
        return
    twin = c_twin.CellTwin(tmp_path, 20)
    twin.kernel()
    ours = twin.outcomes
    twin.c()
    np.testing.assert_array_equal(ours, twin.outcomes)
    assert ours["growth"].max() > 1.0 > ours["growth"].min()
