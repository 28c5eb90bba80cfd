# SPDX-License-Identifier: Apache-2.0
"""The reference device on UDP, and what compiles and configures it."""

import contextlib
import math
import os
import runpy
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import firmware_builds
import link_frames as link
import pytest
import waiting
from firmware_builds import FIRMWARE, ROOT

from haptic_device.config import files
from haptic_device.config.description import load_device, parse
from haptic_device.config.parameters import LOOPBACK
from haptic_display.run import reference_device
from haptic_display.run.device_programs import device_programs

MS = 1_000_000


class Device:
    """A reference device that runs; `say` sets an input."""

    def __init__(self, start, *options, config=""):
        if config:
            file = firmware_builds.folder() / f"{os.getpid()}_{time.monotonic_ns()}.config"
            file.write_text(config)
            options = (*options, "--config", str(file))
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        self.process = start([firmware_builds.device(), *map(str, options)], **pipes)
        self.line = self.process.stdout.readline().split()

    def say(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self, number=signal.SIGTERM):
        """What it says at its end."""
        self.process.send_signal(number)
        said, complained = self.process.communicate()
        assert (self.process.returncode, complained) == (0, "")
        return said


@pytest.fixture
def device(start):
    """Starts devices."""
    return lambda *options, **more: Device(start, *options, **more)


def udp(device, **more):
    return contextlib.closing(link.UdpHost(int(device.line[1]), **more))


def is_sample(frame):
    return frame.kind == link.SAMPLE


def changes(file):
    """(time [ns], force on x) of a device's log, and the times at which its commands began to act."""
    lines = [line.split() for line in file.read_text().splitlines()]
    return [(int(w[0]), float(w[1])) for w in lines if len(w) == 4], [int(w[0]) for w in lines if len(w) == 1]


def test_a_device_on_udp_is_driven_and_cut_to_the_nanosecond(device, tmp_path):
    log, config = tmp_path / "log", "watchdog 0.2\nmotor_constant 2 1 1\nmotor_sign -1 1 1\nencoder_sign -1 1 1\n"
    running = device("--udp", 0, "--log", log, config=config)
    with udp(running) as host:
        greeting = link.greeting(host.greet())
        assert greeting.name == b"reference" and greeting.largest_motor == (7.5, 15.0, 1.0)
        assert greeting[5:] == (100_000, 200 * MS, 32, 1) and greeting.counts_per_unit[0] == 2e5
        deadline = host.now() + 100 * MS
        said = host.command(deadline, 5 * MS, (1.0, 0.0, 0.0))
        sample = link.sample(host.until(lambda frame: is_sample(frame) and frame.answers == said))
        assert (sample.deadline, sample.sampled) == (deadline, deadline)
        t, lag = (deadline - sample.applied) * 1e-9, 0.1 / 3.0
        way = -2.0 / 3.0 * (t - lag * (1 - math.exp(-t / lag)))
        assert sample.counts == (math.floor(-way * 2e5 + 0.5), 0, 0)
        assert sample.damper[0] == pytest.approx(-2.0 * (1 - math.exp(-t / lag)), rel=1e-6)
        cut = host.until(lambda frame: is_sample(frame) and frame.flags == link.CUT)
        assert cut.answers == 0 and link.sample(cut).deadline == sample.applied + 200 * MS
        truth = link.truth(host.until(lambda frame: frame.kind == link.TRUTH and not frame.flags & 2))
        assert truth.motor_force == (0.0, 0.0, 0.0) and truth.position[0] < way and truth.energy == 0.0
    assert running.end() == "frames refused 0, watchdog cuts 1, energy given 0 J\n"
    assert changes(log) == ([(sample.applied, -2.0), (sample.applied + 200 * MS, 0.0)], [sample.applied])


def test_inputs_of_a_device_are_set_by_lines(device):
    running = device("--udp", 0)
    with udp(running) as host:
        host.greet()

        def shown(flags):
            return link.sample(host.until(lambda frame: is_sample(frame) and frame.flags == flags))

        assert shown(0).temperature == -32768
        running.say("temperature 71.5\nlimit 1")
        assert shown(link.END_SWITCH).temperature == 715
        running.say("limit 0\njump 5000\nestop 1")
        assert shown(link.ESTOP).counts == (5000, 0, 0)
        running.say("estop 0\ntemperature 80")
        assert shown(link.ESTOP | link.HOT).temperature == 800
        running.say("temperature 79.9")
        waiting.until(lambda: shown(link.ESTOP | link.HOT).temperature == 799, "a colder device")
        host.command(host.now() + MS, engaged=False)
        shown(0)
        running.process.stdin.close()
        running.process.stdin = None
        host.greet()
    assert "watchdog cuts" in running.end()


def test_a_device_ends_with_its_parent():
    parent = (
        "import subprocess, sys\n"
        "device = subprocess.Popen([sys.argv[1], '--udp', '0'], stdout=subprocess.PIPE, text=True)\n"
        "print(device.stdout.readline() and device.pid, flush=True)\n"
        "sys.stdin.read()\n"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", parent, firmware_builds.device()], **pipes) as process:
        stat = Path(f"/proc/{int(process.stdout.readline())}/stat")
        process.kill()
    waiting.until(lambda: not stat.exists() or stat.read_text().split()[2] == "Z", "the end of the device")


SENTENCES = {  # what is wrong with the settings, or with the options after --udp 0
    "mas 1 1 1": "line 1: mas is no key that is known",
    "axes 2\nmass 1 1": "line 2: mass has 2 numbers; write 3",
    "mass 1 nan 1": "line 1: mass is nan kg | kg m2; the limits are 1e-12 and 1e+09",
    "sensing_delay 0.101": "line 1: sensing_delay is 0.101 s; the limits are 0 and 0.1",
    "motion jump": "line 1: motion is jump; write waypoints, circle or follow",
    "hand_damping 9999999 0 0": "axis 1 as fast as 1e+08 1/s; the limit is 100000 1/s",
    "waypoint 1 0 0 0 1\nwaypoint 0.5 0 0 0 1": "comes after one at 1 s; write them in the order of their times",
    ("--pty", "/tmp/x"): "write either --udp PORT or --pty LINK",
    ("--frob", "1"): "--frob is no option that is known",
    ("--bind", "nowhere"): "nowhere:0: Invalid argument",
    ("--config", "/nowhere"): "/nowhere: No such file or directory",
}


def test_what_is_wrong_is_said_in_a_sentence(tmp_path):
    for wrong, sentence in SENTENCES.items():
        if isinstance(wrong, str):
            (tmp_path / "config").write_text(wrong + "\n")
            wrong = "--config", str(tmp_path / "config")
        words = [firmware_builds.device(), "--udp", "0", *wrong]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1), wrong
        assert done.stderr.rstrip("\n").endswith(sentence)


# ---- what starts it ----

VALUES = {parameter.name: parameter.default for parameter in LOOPBACK}


def test_make_builds_the_reference_device(tmp_path):
    copy = shutil.copytree(FIRMWARE, tmp_path / "firmware", ignore=shutil.ignore_patterns("build"))
    subprocess.run(["make", "-s", "-C", str(copy), "CC=gcc"], check=True)
    assert (copy / "build/reference_device").is_file()


def test_an_installed_package_finds_all_that_it_compiles(monkeypatch, tmp_path):
    """What setup.py installs, in the place where it installs it, of a package that has no source tree around it."""
    monkeypatch.chdir(ROOT)
    told = {}
    monkeypatch.setattr("setuptools.setup", lambda **facts: told.update(facts))
    runpy.run_path("setup.py")
    for folder, copied in told["data_files"]:
        for file in copied:
            (tmp_path / folder).mkdir(parents=True, exist_ok=True)
            shutil.copy(file, tmp_path / folder)
    monkeypatch.setattr("sys.prefix", "/nowhere")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.setattr(files, "__file__", str(tmp_path / "lib/haptic_device/config/files.py"))
    with pytest.raises(ValueError, match="^the firmware's sources are not in "):
        reference_device.sources()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert reference_device.sources() == tmp_path / "share/haptic_display/firmware"
    assert reference_device.compiled().is_file()


def test_without_a_compiler_or_with_one_that_refuses_a_sentence_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(ValueError, match=r"^the reference device needs a C compiler \(\$CC, cc, gcc, clang\); install"):
        reference_device.compiled()
    refusing = tmp_path / "cc"
    refusing.write_text("#!/bin/sh\necho 'x.c:1: note' >&2\necho 'x.c:1: error: no' >&2\nexit 1\n")
    refusing.chmod(0o755)
    with pytest.raises(ValueError, match="^cc does not compile the reference device: x.c:1: error: no$"):
        reference_device.compiled()


def test_a_described_device_is_one_that_the_reference_device_takes(device):
    for script in ("insert_peg", "circle", "follow"):
        values = VALUES | {"motion.name": script, "motion.target": (0.04, -0.02, 0.5)}
        with udp(device("--udp", 0, config=reference_device.config_of(load_device("desktop"), values))) as host:
            greeting = link.greeting(host.greet())
        assert greeting.name == b"desktop" and greeting.counts_per_unit == (200000.0, 200000.0, 40000.0)
        assert greeting.watchdog == 15 * MS
    for name, told in (("", b"unnamed"), ("Gerät#" + "x" * 25, b"Ger?t?" + b"x" * 18)):
        described = load_device("desktop").model_copy(update={"name": name})
        with udp(device("--udp", 0, config=reference_device.config_of(described, VALUES))) as host:
            assert link.greeting(host.greet()).name == told


def test_places_of_the_world_are_told_in_the_devices_own_units():
    axis = {"counts_per_unit": 1000.0, "motor_limit": 2.0, "workspace": [-1.0, 1.0], "velocity_limit": 1.0}
    axes = [{"name": name, "mass": 0.1, "damping": 1.0, **axis} for name in ("x", "y")]
    described = parse({"name": "small", "axes": axes, "scale": [2.0, 1.0], "gravity": [0.0, -9.81]}, "small")
    values = VALUES | {"motion.name": "waypoints", "motion.waypoints": (0.2, 0.1, 0.7), "motion.start": (0.1, 0.0, 0.3)}
    lines = reference_device.config_of(described, values).splitlines()
    assert {"axes 2", "start 0.05 0.0 0.0", "gravity 0.0 -9.81 0.0", "motor_limit 2.0 2.0 2.0"} <= set(lines)
    assert [line for line in lines if line.startswith("waypoint")] == [
        "waypoint 0.0 0.05 0.0 0.0 1.0",
        "waypoint 4.0 0.1 0.05 0.0 1.0",
    ]
    circle = reference_device.config_of(described, VALUES | {"motion.name": "circle"}).splitlines()
    assert {"motion circle", "radius 0.015", "turns 4.0", "duration 4.0"} <= set(circle)
    with pytest.raises(ValueError, match=r"^motor_watchdog is 4.01 s; the reference device stands 4 s at most$"):
        reference_device.config_of(described, VALUES | {"motor_watchdog": 4.01})


def test_a_watchdog_that_a_tool_makes_longer_is_a_simulated_devices_alone(tmp_path):
    def told(name):
        return [p.parameters.get("motor_watchdog") for p in device_programs(name, {"motor_watchdog": 1.0}, tmp_path)]

    assert told("desktop") == [1.0]
    assert told("reference_udp") == [None, 1.0]  # the device has it in its settings
    assert "watchdog 1.0" in (tmp_path / "reference_device.txt").read_text().splitlines()
    assert told("moteus_knob") == [None]
    assert told("own_device") == []
