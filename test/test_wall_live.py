# SPDX-License-Identifier: Apache-2.0
"""A rigid wall on live nodes behind 20 ± 10 ms and 10 % loss: steady and passive by default, and not with `direct`."""

import json
import subprocess
import sys

import numpy as np
import pytest

from haptic_device.analysis.recording import load
from haptic_device.law import passivity

pytestmark = pytest.mark.live

STIFFNESS, BUDGET = 2000.0, 0.005  # [N/m], [J]
NETWORK = ("--delay", "20", "--jitter", "10", "--loss", "0.1")


def pressed(folder, *options):
    """Figures, recording, and rows of the trace while engaged, of a demo at the wall behind the bad network."""
    command = [sys.executable, "-m", "haptic_sim.cli.main", "demo", "--scene", "wall", "--json", *NETWORK, *options]
    demo = subprocess.run([*command, "--out", str(folder / "run")], capture_output=True, text=True, timeout=280)
    found = json.loads(demo.stdout)
    recording = load(found["bag"])
    return found, recording, recording.trace[recording.trace["engage"] > 0]


@pytest.mark.timeout(300)
def test_by_default_the_wall_is_steady_passive_and_as_stiff_as_the_coupling(tmp_path):
    found, recording, rows = pressed(tmp_path)
    assert found["done"] and found["exchange"]["age_ms"]["p50"] > 15.0
    assert found["energy_j"]["given_to_operator_max"] <= BUDGET
    resting = (rows["tool_contact"] > 0) & (np.abs(rows["velocity"][:, 0]) < 0.005) & (rows["exchange_fade"] == 1.0)
    held = rows[resting & (rows["force_coupling"][:, 0] > 0.5)]
    force, stretch = held["force_coupling"][:, 0], held["tool_position"][:, 0] - held["position"][:, 0]
    assert len(held) > 400
    coming, rest = slice(0, len(held) // 3), slice(len(held) // 3, len(held) * 2 // 3)
    assert np.std(force[rest]) <= min(0.2, np.std(force[coming]) + 0.05)  # [N] no oscillation that grows
    assert abs(np.mean(force[rest]) / (STIFFNESS * np.mean(stretch[rest])) - 1.0) < 0.05
    late = [1e-6 * float(said.values["lateness_counted_us"]) for said in recording.statuses("haptic_driver")]
    least, most = (3.0 - passivity.least_damping(STIFFNESS, 2.0, 0.25e-3, one) for one in (max(late), 0.0))
    for margin in (float(recording.last_values("haptic_driver")["passivity_margin"]), rows["margin"][-1, 0]):
        assert least - 0.02 <= margin < most  # of the gains, at the lateness measured


@pytest.mark.timeout(300)
def test_direct_exchange_under_the_same_gives_the_operator_more_than_ten_budgets(tmp_path):
    found, *_ = pressed(tmp_path, "--exchange", "direct")
    assert found["energy_j"]["given_to_operator_max"] > 10.0 * BUDGET
