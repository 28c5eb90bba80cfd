# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` and `haptic device` on devices that are programs of their own."""

import contextlib
import json
import math
import subprocess
import time

from codec_host import Emulator, patient_knob
from in_process import haptic
from live_demo import BUSY, demos
from waiting import until

from haptic_device.description import load_device
from haptic_device.parameters import DRIVER, LOOPBACK
from haptic_device.process import ending_with_us
from haptic_sim.supervision import conformance, reference_device

BUDGET = next(parameter.default for parameter in DRIVER if parameter.name == "passivity.budget")  # [J]
LEVER = 0.05 * 2.0 * math.pi  # [m] that the end of the knob's lever goes in a revolution
NUDGE, STEP, DEEP = 0.2e-3, 0.3e-3, -0.021  # [m] to see whether forces act; of the hand; 1 mm into the wall
EACH = 0.004  # [s] between its steps
PATIENT = """
/**/haptic_driver:
  ros__parameters:
    auto_enable: true
    fault: {silence: 1.0, unattended: 0.0}
/**/haptic_bridge:
  ros__parameters:
    motor_watchdog: 0.5
"""  # no fault where a busy machine is late


@contextlib.contextmanager
def running(command):
    with subprocess.Popen(ending_with_us(command), stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def found_of(run):
    return json.loads(run.said.splitlines()[-1])


def test_the_peg_goes_into_the_hole_with_the_reference_device(tmp_path):
    with demos(tmp_path) as demo:
        run = demo("--device", "reference_udp", "--json", *BUSY)
        assert run.ended() == 0, run.progress + run.said
    found = found_of(run)
    assert found["done"] and found["faults"] == [] and found["result"]["insertion_fraction"] >= 0.95
    assert found["energy_j"]["given_to_operator_max"] <= BUDGET


class Hand:
    """Turns the knob into the wall once forces act, and holds it there."""

    def __init__(self, knob):
        self.knob, self.place, self.nudged, self.felt = knob, 0.0, NUDGE, False

    def step(self):
        self.felt = self.felt or any(self.knob.torque()[1:])
        self.place = max(DEEP, self.place - STEP) if self.felt else self.nudged
        self.nudged = -self.nudged
        self.knob.order(f"1 turn {self.place / LEVER!r}")
        time.sleep(EACH)


def test_a_knob_presses_the_wall_of_a_demo_and_the_drives_last_word_is_no_torque(start, tmp_path):
    knob = Emulator(start, "moteus", tmp_path / "log", 1)
    patient_knob(knob, tmp_path / "knob.yaml")
    (tmp_path / "patient.yaml").write_text(PATIENT)
    given = ("--device", str(tmp_path / "knob.yaml"), "--params", str(tmp_path / "patient.yaml"), "--rate", "1000")
    hand = Hand(knob)
    with demos(tmp_path) as demo:
        run = demo(*given, "--seconds", "3", "--json", scene="wall")
        until(lambda: run.process.poll() is not None, "the end of the demo", hand.step)
    assert run.process.returncode == 0, run.progress + run.said
    found = found_of(run)
    assert found["done"] and found["faults"] == [] and found["contact"]["max_force_n"] > 0.1
    assert knob.torque()[1] == 0.0


def test_the_reference_device_keeps_every_promise_behind_its_bridge():
    ended = haptic("device", "test", "reference_udp", "--json")
    results = {one["name"]: one for one in json.loads(ended.stdout)["checks"]}
    assert list(results) == list(conformance.CHECKS)
    in_time = results.pop(conformance.IN_TIME)["passed"]  # of this machine too
    assert [one["sentence"] for one in results.values() if not one["passed"]] == []
    assert ended.returncode == (0 if in_time else 1)


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
