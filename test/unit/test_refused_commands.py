# SPDX-License-Identifier: Apache-2.0
"""Wrong input of the command line: one sentence with name, value, limit and unit, and nothing started or made.

{here} is the folder with the files of FILES in which the commands run.
"""

import math
import shlex
from pathlib import Path

import pytest
from in_process import haptic

from haptic_display.cli.compare import compare
from haptic_display.cli.replay import As
from haptic_display.run import machine_trial, processes

POINT = "/**/haptic_driver:\n  ros__parameters: {{{}}}\n"
TOOL = "tool: {mass: 0.1, shapes: [{circle: {radius: 0.005}}]}\n"
AXIS = "counts_per_unit: 1e5, motor_limit: 15.0, workspace: [-0.1, 0.1], mass: 0.1"
FILES = {
    "empty.yaml": "",
    "list.yaml": "[1, 2]\n",
    "broken.yaml": "a: [1\n",
    "binary.yaml": "\x00\x01",
    "stiff.yaml": POINT.format("coupling.stiffness: 1e9"),
    "unknown.yaml": POINT.format("coupling.stifness: 100.0"),
    "twice.yaml": POINT.format("servo.rate: 1000.0, servo.rate: 2000.0"),
    "device.yaml": POINT.format("device: nowhere"),
    "axes.yaml": POINT.format("device: ./bad.yaml"),
    "bad.yaml": f"name: bad\naxes: [{{name: x, damping: 3.0, {AXIS}}}]\n",
    "flat.yaml": f"name: flat\naxes: [{{name: x, damping: 3.0, velocity_limit: 3.0, {AXIS}}}]\n",
    "stranger.yaml": "/**/haptic_drvier:\n  ros__parameters: {servo.rate: 1000.0}\n",
    "alias.yaml": "/**/haptic_driver: &a\n  ros__parameters: {}\n/**/haptic_loopback: *a\n",
    "heavy.yaml": "name: heavy\n" + TOOL.replace("0.1", "-0.1"),
    "doubled.yaml": "name: doubled\n" + TOOL.replace("mass: 0.1", "mass: 0.1, mass: 5.0"),
    "joint.yaml": "name: joint\njoints: [{type: pin, bodies: [world, nobody], at: [0.0, 0.0]}]\n" + TOOL,
    "answers.yaml": "homing: absolute\n",
}
PASSIVITY = "passivity --stiffness 1e3 --damping 1 --physical-damping 3 --period 1e-3 "
ARMS = "passivity --stiffness 30 --damping 0 --period 1e-3 --device haply_2diy_gen3"
NO_FILE, FULL = "No such file or directory", "/dev/full: No space left on device"
NOWHERE = "nowhere is neither a file nor a name in config/"
INPUTS = {
    "check empty.yaml": "the file holds no mapping of names to values",
    "check broken.yaml": "line 2 is not YAML",
    "check binary.yaml": "this is not a YAML text",
    "check nowhere.yaml": f"nowhere.yaml: {NO_FILE}",
    "check .": ".: Is a directory",
    "check stiff.yaml": "coupling.stiffness is 1000000000.0 N/m; at most",
    "check unknown.yaml": "did you mean coupling.stiffness?",
    "check twice.yaml": "servo.rate is written twice, the second time in line 2",
    "check device.yaml": "device 'nowhere' is neither the file {here}/nowhere nor a name in config/devices",
    "check stranger.yaml": "haptic_drvier is not a node of this package; did you mean haptic_driver?",
    "check alias.yaml": "ROS 2 parameter files have no aliases (*name)",
    "check heavy.yaml": "tool.mass is -0.1: it should be greater than 0 kg",
    "check heavy.yaml --out a.csv": "--out is for --verify, and --lateness for all but --verify",
    "check wall --verify --lateness 1": "--out is for --verify, and --lateness for all but --verify",
    "check --verify nowhere": f"{NOWHERE}scenes",
    "check --verify desktop": "desktop is neither a file nor a name in config/scenes",
    "check --verify unknown.yaml": "unknown.yaml: has no key",
    "check wall --verify --out /nowhere/a.csv": "/nowhere/a.csv",
    "check --verify wall --out heavy.yaml": "has not the columns scene, method, step_us",
    "check doubled.yaml": "mass is written twice, the second time in line 2",
    "check joint.yaml": "joints[0].bodies[1] is 'nobody'; it must be one of tool, world",
    "compile nothing": "no kernels are called nothing; there are",
    "demo --exchange guess": "exchange.method is 'guess'; it must be one of direct, pspm, local",
    "demo --scene doubled.yaml": "doubled.yaml: mass is written twice",
    "demo --params stiff.yaml": "stiff.yaml: /**/haptic_driver: coupling.stiffness is 1000000000.0 N/m; at most",
    "demo --params axes.yaml --scene wall": "device {here}/bad.yaml: axes[0].velocity_limit is missing; add it",
    "demo --params unknown.yaml --out run --view": "coupling.stifness is not a parameter of haptic_driver; did you",
    "demo --params device.yaml --out run": "device.yaml: haptic_driver: device 'nowhere' is neither the file",
    "demo --params broken.yaml --out run": "broken.yaml: line 2 is not YAML",
    "demo --out list.yaml": "--out list.yaml exists already",
    "device find --silent --udp nowhere": "--udp is 'nowhere'; HOST:PORT is needed, the port from 1 to 65535",
    "device find --silent --udp 127.0.0.1:65536": "--udp is '127.0.0.1:65536'; HOST:PORT is needed",
    "device find --watch --udp 127.0.0.1:9": "--watch is for what is plugged in: leave --udp out",
    "device kinematics desktop --joints 1": "desktop has no joints: each of its motors moves an axis",
    "device kinematics serial_2r": "give --joints or --position, and not both",
    "device kinematics serial_2r --joints 1,2 --position 3,4": "give --joints or --position, and not both",
    "device kinematics serial_2r --joints 3": "joints is '3'; two numbers A,B in degrees are needed",
    "device kinematics hapkit --position nan": "position is 'nan'; a number in m is needed",
    "device kinematics serial_2r --joints 30,-60": "joints is 30,-60 degrees; the handle of serial_2r cannot be there",
    "device kinematics serial_2r --position 0.2,0": "position is 0.2,0 m; the handle of serial_2r cannot be there",
    "device kinematics hapkit --position 5": "joint pulley is at 7.616e+04°, and its limits are -1031° to 1031°",
    "device set-up desktop": "haptic device set-up: it asks for what only a hand at the device can tell",
    "device set-up desktop --answers none.yaml --out b.yaml": f"none.yaml: {NO_FILE}",
    "device set-up desktop --answers answers.yaml --out .": "--out is ., but it must be a new file in a folder that",
    "device set-up haply_2diy_gen3 --answers answers.yaml --out b.yaml": (
        "haptic device set-up: haply_2diy_gen3 is a five_bar, and set-up measures axes, not joints: write "
        "encoder_sign, counts_per_rad, zero and motor_sign of each joint by hand, with haptic device show beside it"
    ),
    "device set-up nowhere --answers answers.yaml --out b.yaml": f"{NOWHERE}devices",
    "device test nowhere": f"haptic device test: {NOWHERE}devices",
    "device test --namespace 4x": "namespace is '4x'",
    "docs --out /nowhere/a.md": f"haptic: /nowhere/a.md: {NO_FILE}",
    "docs --out /dev/full": f"haptic: {FULL}",
    "identify --force 0": "force is 0 N, but it must be a finite number greater than 0 N",
    "identify --force 15.1": "force is 15.1 N, but the motor of axis x gives at most 15 N",
    "identify --torque -0.1": "torque is -0.1 N m, but it must be a finite number greater than 0",
    "identify --torque 1.1": "torque is 1.1 N m, but the motor of axis theta gives at most 1 N m",
    "identify --torque 0.1 --device flat.yaml": "haptic identify: torque is 0.1 N m, but flat has no theta",
    "identify --device nowhere": f"{NOWHERE}devices",
    "identify --out /nowhere/found.yaml": "/nowhere/found.yaml, but it must be a file in a folder that",
    f"{PASSIVITY} --stiffness -1": "stiffness is -1 N/m, but it must lie between 0 and 1e+12 N/m",
    f"{PASSIVITY} --stiffness 1.1e12": "stiffness is 1.1e+12 N/m, but it must lie between 0 and 1e+12 N/m",
    f"{PASSIVITY} --physical-damping 0": "physical_damping is 0 N s/m, but it must be a finite number greater than 0",
    f"{PASSIVITY} --period 0": "period is 0 s, but it must be a finite number greater than 0 s",
    f"{PASSIVITY} --mass 0": "mass is 0 kg",
    f"{PASSIVITY} --delay-samples -0.1": "delay_samples is -0.1 samples, but it must lie between 0 and 100 samples",
    f"{PASSIVITY} --delay-samples 100.1": "delay_samples is 100.1 samples, but it must lie between 0 and 100 samples",
    f"{PASSIVITY} --velocity-lag -1": "velocity_lag is -1 s",
    f"{PASSIVITY} --resolution -1": "resolution is -1 m",
    f"{PASSIVITY} --coulomb -1": "coulomb is -1 N",
    f"{PASSIVITY} --plot /nowhere/a.png": f"haptic passivity: /nowhere/a.png: {NO_FILE}",
    f"{ARMS} --joints=120,60 --position=0.02,0.13": "give one of them",
    f"{ARMS} --joints=120,60 --device desktop": "--joints is of a linkage, and desktop has motors on its axes",
    f"{ARMS} --position=0.3,0.1": "position is 0.3,0.1 m; the handle of haply_2diy_gen3 cannot",
    f"{ARMS} --joints=60,120": "60,120 degrees; joint joint_1 is at 60°, and its limits are 68.75° to ",
    f"{ARMS} --joints=120": "joints is '120'; two numbers A,B in degrees are needed",
    f"{ARMS} --physical-damping=0": "physical_damping is 0 N m s/rad",
    "replay nowhere --delay inf": "--delay is inf; a finite number in s is needed",
    "replay nowhere --check --as device": "replay --check takes no --as device:",
    "replay nowhere --check --delay 0.01": "replay --check takes no --delay:",
    "replay nowhere --check --out out": "replay --check takes no --out:",
    "report nowhere": "bag nowhere does not exist",
    "scenes --draw nowhere": f"{NOWHERE}scenes",
    "scenes --draw wall --out /nowhere/a.png": f"haptic: /nowhere/a.png: {NO_FILE}",
    "scenes --draw wall --out /dev/full": f"haptic: {FULL}",
    "scenes --out a.png": "--out names the picture of --draw; give it with --draw",
    "status --namespace a+b": "namespace is 'a+b'; words of letters, digits and _ are needed, such as /haptic",
    "zwidth --damping 3": "--damping needs --live",
    "zwidth --domain 3 --namespace /a": "--domain, --namespace needs --live",
    "zwidth --operator strong": "operator is 'strong', but it must be one of none, light, firm, worst",
    "zwidth --device nowhere": f"{NOWHERE}devices",
    "zwidth --damping-max 0": "damping_max is 0 N s/m",
    "zwidth --lateness 0.00051": "lateness is 0.00051 s, but it must lie between 0 and 0.0005 s",
    "zwidth --seconds 0": "seconds is 0 s",
    "zwidth --physical-damping nan": "physical_damping is nan N s/m",
    "zwidth --live --device serial_2r": "the workspace of serial_2r is 0.03 to 0.12 m along y",
    "zwidth --live --mass 1 --out map": "with --live, --mass, --out has no meaning",
    "zwidth --live --period 1": "servo.rate is 1.0 Hz; at least 500.0 Hz is needed",
    "zwidth --live --period 0.00005": "servo.rate is 20000.0 Hz; at most 10000.0 Hz is allowed",
    "zwidth --live --damping -1": "wall.damping[0] is -1.0 N s/m; at least 0.0 N s/m is needed",
    "zwidth --live --stiffness-max 0": "stiffness_max is 0 N/m",
}
TAKEN = "--stiffness 0", "--physical-damping 1e-9", "--period 1e-9", "--mass 1e-3", "--delay-samples 100", "--coulomb 0"
"""What `haptic passivity` takes just inside of its bounds."""
ELSEWHERE = "view --namespace a+b", "record --field nonsense", "status --namespace a+b", "demo --scene nowhere"
VIEW, RECORD, STATUS, DEMO = ELSEWHERE
LIMITED = [
    (DEMO, "--seconds", "s", 0.5, 3600.0),
    (DEMO, "--delay", "ms", 0.0, 2000.0),
    (DEMO, "--jitter", "ms", 0.0, 2000.0),
    (DEMO, "--loss", "", 0.0, 1.0),
    (DEMO, "--rate", "Hz", 500.0, 10000.0),
    (DEMO, "--port", "", 0, 65535),
    (VIEW, "--port", "", 0, 65535),
    ("doctor", "--seconds", "s", 0.2, 60.0),
    (RECORD, "--seconds", "s", 0.1, 1e7),
    (RECORD, "--split-size", "MB", 0.0, 1e6),
    (RECORD, "--split-duration", "s", 0.0, 1e6),
    (STATUS, "--domain", "", 0, 232),
    ("device find --silent --udp nowhere", "--wait", "s", 0.1, 60.0),
    ("device find --silent --udp nowhere", "--baud", "", 1200, 4_000_000),
    ("device test nowhere", "--motor", "motor units", 0.0, 1.0),
    ("device show --namespace a+b", "--domain", "", 0, 232),
    ("identify --force 0", "--rate", "Hz", 500.0, 10000.0),
    ("zwidth --damping 3", "--points", "", 2, 1000),
]
"""Numbers with a least and a most value, in commands that are refused for another word if these are taken."""


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """The folder; from a command that starts a node or a trial comes an AssertionError, or no trial."""
    folder = tmp_path_factory.mktemp("here")
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")

    def start(nodes, program):
        raise AssertionError(f"{program.name} was started")

    def trial(seconds):
        raise ValueError("no trial here")

    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(processes.Nodes, "start", start)
        patch.setattr("haptic_display.device_tools.zwidth.on_pair", None)
        patch.setattr(machine_trial, "examine", trial)
        yield folder


def refused(words):
    """The one sentence of a command."""
    done = haptic(*shlex.split(words))
    said = (done.stdout + done.stderr).strip()
    assert done.returncode in (1, 2), (words, said)
    assert len(said.splitlines()) == 1, said
    return said


@pytest.mark.parametrize("command", sorted({words.split()[0] for words in INPUTS}))
def test_a_wrong_input_is_one_sentence_and_makes_nothing(command, here):
    for words, sentence in INPUTS.items():
        if words.split()[0] == command:
            said = refused(words)
            assert sentence.format(here=here) in said, (words, said)
            assert "Errno" not in said and "validation" not in said
    assert sorted(path.name for path in here.iterdir()) == sorted(FILES)


def test_more_operating_points_than_a_page_shows_are_refused_before_the_first_is_played(here):
    with pytest.raises(ValueError, match="7 operating points are given; at most 6"):
        compare(Path("nowhere"), ["demo"] * 7, As.target, 0.0, here / "out", None)
    assert not (here / "out").exists()


def test_passivity_takes_what_is_just_inside_of_its_bounds():
    for words in TAKEN:
        assert haptic(*f"{PASSIVITY} {words}".split()).returncode == 0, words


def test_passivity_refuses_what_is_no_finite_number():
    names = "stiffness", "damping", "physical-damping", "period", "mass", "velocity-lag", "resolution", "coulomb"
    for option in names:
        for value in ("nan", "inf", "soon"):
            said = refused(f"{PASSIVITY} --{option} {value}")
            assert f"is {value}" in said or f"is {value!r}" in said or f"{value!r} is" in said, said
            assert option in said or option.replace("-", "_") in said


@pytest.mark.parametrize(("words", "option", "unit", "low", "high"), LIMITED)
def test_a_number_beyond_its_limits_or_none_is_refused_with_limit_and_unit(words, option, unit, low, high, here):
    def amount(value):
        return f"{value!r} {unit}".rstrip()

    kind, other = "" if isinstance(low, float) else "whole ", refused(words)
    under, over = (low - 1, high + 1) if kind else (math.nextafter(low, -math.inf), math.nextafter(high, math.inf))
    assert refused(f"{words} {option} {under}").endswith(
        f"{option} is {amount(under)}; at least {amount(low)} is needed"
    )
    assert refused(f"{words} {option} {over}").endswith(
        f"{option} is {amount(over)}; at most {amount(high)} is allowed"
    )
    assert refused(f"{words} {option} {low}") == refused(f"{words} {option} {high}") == other
    for value in ("soon", "nan", "inf", "-inf"):
        needed = f"a {kind}number" if kind or value == "soon" else "a finite number"
        given = value if not kind and value != "soon" else repr(value)
        said = f"{option} is {given}; {needed}{f' in {unit}' if unit else ''} is needed"
        assert refused(f"{words} {option} {value}").endswith(said)
