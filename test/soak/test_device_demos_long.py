# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` on a reference device behind a terminal, and on a device that a process of one's own serves."""

import json
import subprocess

from firmware_builds import FIRMWARE
from live_demo import BUSY, demos

from haptic_device.config.parameters import DRIVER

BUDGET = next(parameter.default for parameter in DRIVER if parameter.name == "exchange.budget")  # [J]


def found_of(run):
    assert run.ended() == 0, run.progress + run.said
    return json.loads(run.said.splitlines()[-1])


def test_the_peg_goes_into_the_hole_with_the_reference_device_on_a_terminal(tmp_path):
    with demos(tmp_path) as demo:
        found = found_of(demo("--device", "reference_pty", "--json", *BUSY))
    assert found["done"] and found["faults"] == [] and found["result"]["insertion_fraction"] >= 0.95
    assert found["energy_j"]["given_to_operator_max"] <= BUDGET


def test_a_demo_runs_on_a_device_that_a_process_of_ones_own_serves(ros_domain, start, tmp_path):
    program, source = tmp_path / "own_device", FIRMWARE / "examples/own_device.c"
    subprocess.run(["cc", "-std=c99", "-O2", "-o", program, source], check=True)
    device = start([program, str(ros_domain)], stdout=subprocess.PIPE)
    assert device.stdout.readline() == f"own_device: serves /dev/shm/haptic_display.{ros_domain}.haptic\n"
    with demos(tmp_path) as demo:
        found = found_of(demo("--device", "own_device", "--seconds", "3", "--json", *BUSY, scene="wall"))
    assert found["done"] and found["faults"] == [] and found["seconds"] >= 3.0
    assert found["exchange"]["answered"] > 0
    assert device.poll() is None
