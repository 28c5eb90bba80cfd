# SPDX-License-Identifier: Apache-2.0
"""Forty wrong inputs of the command line: one sentence each, with name, value and limit, no traceback, no error number.

{here} is an empty folder with the files of FILES, in which the command runs.
"""

import pytest
from in_process import haptic

POINT = "/**/haptic_driver:\n  ros__parameters: {{{}}}\n"
TOOL = "tool: {mass: 0.1, shapes: [{circle: {radius: 0.005}}]}\n"
FILES = {
    "empty.yaml": "",
    "list.yaml": "[1, 2]\n",
    "broken.yaml": "a: [1\n",
    "plain.yaml": "a: 1\n",
    "binary.yaml": "\x00\x01",
    "stiff.yaml": POINT.format("coupling.stiffness: 1e9"),
    "unknown.yaml": POINT.format("coupling.stifness: 100.0"),
    "text.yaml": POINT.format("servo.rate: 1:30"),
    "twice.yaml": POINT.format("servo.rate: 1000.0, servo.rate: 2000.0"),
    "device.yaml": POINT.format("device: nowhere"),
    "stranger.yaml": "/**/haptic_drvier:\n  ros__parameters: {servo.rate: 1000.0}\n",
    "alias.yaml": "/**/haptic_driver: &a\n  ros__parameters: {}\n/**/haptic_loopback: *a\n",
    "heavy.yaml": "name: heavy\n" + TOOL.replace("0.1", "-0.1"),
    "shapeless.yaml": "name: shapeless\ntool: {mass: 0.1, shapes: []}\n",
    "sexagesimal.yaml": "name: sexagesimal\n" + TOOL.replace("0.1", "1:30"),
    "doubled.yaml": "name: doubled\n" + TOOL.replace("mass: 0.1", "mass: 0.1, mass: 5.0"),
    "joint.yaml": "name: joint\njoints: [{type: pin, bodies: [world, nobody], at: [0.0, 0.0]}]\n" + TOOL,
}
DISPLAY = "passivity --stiffness {} --damping 0 --physical-damping {} --period {}"
INPUTS = {
    "check empty.yaml": "the file holds no mapping of names to values",
    "check list.yaml": "the file holds no mapping of names to values",
    "check broken.yaml": "line 2 is not YAML",
    "check plain.yaml": "neither an operating point (ros__parameters), a device description (axes) nor a scene",
    "check binary.yaml": "this is not a YAML text",
    "check nowhere.yaml": "nowhere.yaml: No such file or directory",
    "check .": ".: Is a directory",
    "check stiff.yaml": "coupling.stiffness is 1000000000.0 N/m; at most",
    "check unknown.yaml": "did you mean coupling.stiffness?",
    "check text.yaml": "servo.rate is '1:30' (text); a number with a decimal point in Hz is needed",
    "check twice.yaml": "servo.rate is written twice, the second time in line 2",
    "check device.yaml": "device 'nowhere' is neither the file {here}/nowhere nor a name in config/devices",
    "check stranger.yaml": "haptic_drvier is not a node of this package; did you mean haptic_driver?",
    "check alias.yaml": "ROS 2 parameter files have no aliases (*name)",
    "check heavy.yaml": "tool.mass is -0.1: it should be greater than 0 kg",
    "check shapeless.yaml": "tool.shapes: it has 0 entries, and should have at least 1",
    "check sexagesimal.yaml": "tool.mass is '1:30'",
    "check doubled.yaml": "mass is written twice, the second time in line 2",
    "check joint.yaml": "joints[0].bodies[1] is 'nobody'; it must be one of tool, world",
    "scenes --draw doubled.yaml": "doubled.yaml: mass is written twice",
    "scenes --draw nowhere": "nowhere is neither a file nor a name in config/scenes",
    "scenes --draw wall --out /nowhere/a.png": "/nowhere/a.png: No such file or directory",
    "demo --exchange guess": "exchange.method is 'guess'; it must be one of direct, wave, pspm, local",
    "demo --scene doubled.yaml": "doubled.yaml: mass is written twice",
    "demo --params twice.yaml": "twice.yaml: servo.rate is written twice",
    "demo --params stranger.yaml": "stranger.yaml: haptic_drvier is not a node of this package",
    "demo --out list.yaml": "--out list.yaml exists already",
    "report nowhere": "bag nowhere does not exist",
    "recover nowhere": "bag nowhere does not exist",
    "replay nowhere --delay inf": "--delay is inf; a finite number in s is needed",
    "replay nowhere --check --live": "replay --check takes no --live",
    DISPLAY.format("nan", 1, 0.001): "stiffness is nan N/m, but it must lie between 0 and 1e+12 N/m",
    DISPLAY.format(1, -1, 0.001): "physical_damping is -1 N s/m, but it must be a finite number greater than 0 N s/m",
    DISPLAY.format(1, 1, 0): "period is 0 s, but it must be a finite number greater than 0 s",
    DISPLAY.format(1, 1, 0.001) + " --plot /nowhere/a.png": "/nowhere/a.png: No such file or directory",
    "zwidth --damping 3": "--damping needs --live",
    "zwidth --points 1": "--points is 1; at least 2 is needed",
    "zwidth --operator strong": "operator is 'strong', but it must be one of none, light, firm, worst",
    "identify --force nan": "force is nan N",
    "status --namespace a+b": "namespace is 'a+b'; words of letters, digits and _ are needed, such as /haptic",
    "docs --out /nowhere/a.md": "/nowhere/a.md: No such file or directory",
    "compile nothing": "no kernels are called nothing; there are",
}


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    folder = tmp_path_factory.mktemp("here")
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("words", INPUTS)
def test_a_wrong_input_is_one_sentence_and_makes_nothing(words, here, monkeypatch):
    monkeypatch.chdir(here)
    before = sorted(here.iterdir())
    done = haptic(*words.split())
    said = (done.stdout + done.stderr).strip()
    assert done.returncode in (1, 2)
    assert INPUTS[words].format(here=here) in said
    assert len(said.splitlines()) == 1 and "Errno" not in said and "validation" not in said
    assert sorted(here.iterdir()) == before
