# SPDX-License-Identifier: Apache-2.0
"""What pages use, made patient with a machine that tests keep busy: programs, and the example of a device.

`python test/patient.py PROGRAM …` is haptic, haptic_driver or haptic_loopback with patient.yaml behind its parameters.
"""

import os
import shutil
import sys
from pathlib import Path

from haptic_device.config.files import find

FIRMWARE = Path(__file__).parents[1] / "firmware"
WATCHDOG, LONGER = "WATCHDOG INT64_C(15000000)", "WATCHDOG INT64_C(500000000)"  # [ns] of the example of a device
BEHIND = Path(__file__).with_suffix(".yaml")
PROGRAMS = ("haptic", "haptic_driver", "haptic_loopback")


def write_programs(folder):
    """Puts the programs into this new folder, which is to be the first of PATH."""
    folder.mkdir()
    for name in PROGRAMS:
        program = folder / name
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{__file__}" {name} "$@"\n')
        program.chmod(0o755)


def write_firmware(folder):
    """A copy of firmware/ as in the folder of the sources, where a page begins."""
    shutil.copytree(FIRMWARE, folder / "firmware")
    example = folder / "firmware/examples/own_device.c"
    text = example.read_text(encoding="utf-8")
    assert WATCHDOG in text
    example.write_text(text.replace(WATCHDOG, LONGER), encoding="utf-8")


def _words(program, words):
    if program != "haptic":
        return [*words, "--params-file", str(BEHIND)]
    if words[:1] != ["demo"]:
        return words
    name = words[words.index("--params") + 1] if "--params" in words else "demo"
    try:
        point = find("", name)
    except FileNotFoundError:
        return words  # it is refused
    beside = point.parent if str(point) == name else Path()  # its device and scene may be paths from its folder
    patient = beside / f".patient_{point.name}"
    patient.write_text(point.read_text(encoding="utf-8") + BEHIND.read_text(encoding="utf-8"), encoding="utf-8")
    return [*words, "--params", str(patient)]


def _main(name, *words):
    command = [str(Path(sys.executable).with_name(name)), *_words(name, list(words))]
    os.execv(command[0], command)


if __name__ == "__main__":
    _main(*sys.argv[1:])
