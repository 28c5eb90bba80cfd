# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` and `haptic device` on devices that are programs of their own."""

import contextlib
import json
import subprocess

import pytest
from in_process import haptic
from live_demo import BUSY, demos

from haptic_device.config.description import load_device
from haptic_device.config.parameters import DRIVER, LOOPBACK
from haptic_device.process import ending_with_us
from haptic_display.device_tools import conformance
from haptic_display.run import reference_device

BUDGET = next(parameter.default for parameter in DRIVER if parameter.name == "exchange.budget")  # [J]


@contextlib.contextmanager
def running(command):
    with subprocess.Popen(ending_with_us(command), stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def found_of(run):
    return json.loads(run.said.splitlines()[-1])


@pytest.mark.realtime
def test_the_peg_goes_into_the_hole_with_the_reference_device(tmp_path):
    with demos(tmp_path) as demo:
        run = demo("--device", "reference_udp", "--json", *BUSY)
        assert run.ended() == 0, run.progress + run.said
    found = found_of(run)
    assert found["done"] and found["faults"] == [] and found["result"]["insertion_fraction"] >= 0.95
    assert found["energy_j"]["given_to_operator_max"] <= BUDGET


@pytest.mark.realtime
def test_the_reference_device_keeps_every_promise_behind_its_bridge():
    ended = haptic("device", "test", "reference_udp", "--json")
    results = {one["name"]: one for one in json.loads(ended.stdout)["checks"]}
    assert list(results) == list(conformance.CHECKS)
    assert [one["sentence"] for one in results.values() if not one["passed"]] == []
    assert ended.returncode == 0


def test_a_reference_device_is_found_by_its_greeting_with_the_line_for_its_description(tmp_path):
    values = {parameter.name: parameter.default for parameter in LOOPBACK}
    (tmp_path / "config").write_text(reference_device.config_of(load_device("reference_udp"), values))
    command = [str(reference_device.compiled()), "--config", str(tmp_path / "config"), "--udp", "0"]
    with running(command) as device:
        port = int(device.stdout.readline().split()[1])
        ended = haptic("device", "find", "--udp", f"127.0.0.1:{port}", "--json")
    found = json.loads(ended.stdout)["found"][-1]
    assert ended.returncode == 0, ended.stderr
    assert found["answer"] == "reference_udp: a simulated device with 3 axes, firmware 1.0.0, watchdog 15 ms"
    assert found["link"] == {"type": "udp", "host": "127.0.0.1", "port": port}
