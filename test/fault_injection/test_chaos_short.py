# SPDX-License-Identifier: Apache-2.0
"""Chaos in its short form on live nodes, which it breaks on purpose."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fault_injection import chaos, fault_injector
from haptic_display.device_tools.zwidth import STALLED

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 720.0  # [s] for all of it; no assertion
BY_THE_CLOCK = {"recovered", "safe", "step", *STALLED}  # what other work on this machine moves


@pytest.mark.timeout(900)
def test_chaos_in_its_short_form_leaves_energy_within_its_budget_only_known_faults_and_nothing_behind(start):
    environment = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = start([sys.executable, chaos.__file__, "--short"], cwd=ROOT, env=environment, **pipes)
    said, progress = process.communicate(timeout=LIMIT)
    assert said, progress
    found = json.loads(said)
    assert found["tracebacks"] == 0 and found["left_over"] == [], progress
    assert tuple(event["event"] for event in found["events"]) == chaos.SHORT, progress
    for event in found["events"]:
        assert set(event["wrong"]) <= BY_THE_CLOCK, progress  # its faults and its energy were as they may be
        assert event["force"] > fault_injector.FORCE and event["runs"] == 1
        assert event["safe"] is not None and math.isfinite(event["safe"])  # it went off, or let go, however late
    assert "estop" in found["events"][-1]["faults"], progress
