# SPDX-License-Identifier: Apache-2.0
"""Which processes a described device needs beside the driver, and what a demo on hardware has to be told."""

import pytest
from in_process import haptic

from haptic_display.run import reference_device
from haptic_display.run.device_programs import MODULES, REFERENCE, device_programs
from haptic_display.run.system import led_by_hand
from haptic_sim.scene.needs import BRIDGE, LOOPBACK, needs_of

HAND = {"motion.name": "hold", "motor_watchdog": 0.5}


@pytest.fixture(autouse=True)
def no_compiler(monkeypatch):
    """What these tests ask is where the program would be."""
    monkeypatch.setattr(reference_device, "compiled", lambda: "/somewhere/reference_device")


def test_each_device_has_the_node_that_serves_its_page():
    served = {"desktop": LOOPBACK, "own_device": "", "reference_udp": BRIDGE, "moteus_knob": BRIDGE}
    assert {name: needs_of("", name).serving for name in served} == served


def test_the_stand_in_gets_the_hand_and_the_files_and_for_somebody_elses_process_nothing_is_started(tmp_path):
    [one] = device_programs("desktop", HAND, tmp_path, (tmp_path / "a.yaml",))
    assert (one.name, one.module, one.files) == (LOOPBACK, MODULES[LOOPBACK], (tmp_path / "a.yaml",))
    assert one.parameters == {"device": "desktop", **HAND}
    assert device_programs("own_device", HAND, tmp_path) == [] == list(tmp_path.iterdir())


def test_hardware_needs_its_bridge_alone_which_has_neither_hand_nor_a_longer_watchdog(tmp_path):
    [one] = device_programs("moteus_knob", HAND, tmp_path)
    assert (one.name, one.module, one.parameters) == (BRIDGE, MODULES[BRIDGE], {"device": "moteus_knob"})
    assert not led_by_hand([one])


@pytest.mark.parametrize("name", ["reference_udp", "reference_pty"])
def test_a_reference_device_is_started_before_its_bridge_with_the_hand_on_the_same_line(tmp_path, name):
    device, bridge = device_programs(name, HAND, tmp_path / "new")
    assert (device.name, bridge.name) == (REFERENCE, BRIDGE) and led_by_hand([device, bridge])
    program, word, settings, kind, line = device.command()
    assert (program, word) == ("/somewhere/reference_device", "--config")
    said = (tmp_path / "new" / "reference_device.txt").read_text()
    assert settings == str(tmp_path / "new" / "reference_device.txt")
    assert "watchdog 0.5" in said.splitlines() and f"name {name}" in said.splitlines()
    assert bridge.parameters == {"device": name, "motor_watchdog": 0.5, "port": line}
    if name == "reference_udp":
        assert kind == "--udp" and 1 <= int(line) <= 65535
    else:
        assert (kind, line) == ("--pty", str(tmp_path / "new" / "reference.pty"))


def test_a_device_of_somebody_elses_program_that_cannot_be_found_is_a_sentence(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    ended = haptic("device", "test", "own_device")
    said = "is served by a program of your own: start it, and give its --domain or ROS_DOMAIN_ID"
    assert (ended.returncode, ended.stdout) == (2, "") and ended.stderr.strip().endswith(said)


@pytest.mark.parametrize("name", ["own_device", "moteus_knob"])
def test_a_demo_on_hardware_without_an_end_is_refused_before_anything_runs(tmp_path, name):
    ended = haptic("demo", "--scene", "wall", "--device", name, "--out", tmp_path / "run")
    assert ended.returncode == 1
    assert "no hand is simulated at this device, whose motion would end the run; write --seconds" in ended.stderr
    assert not (tmp_path / "run" / "log").exists()
