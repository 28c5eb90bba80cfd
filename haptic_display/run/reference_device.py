# SPDX-License-Identifier: Apache-2.0
"""The reference device of firmware/: compiled where it is needed first, and told what a described device is."""

import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from haptic_device.config.description import Device
from haptic_device.config.files import places
from haptic_device.device import operator_hand
from haptic_device.os_errors import in_words

SOURCES = ("*.c", "boards/host/*.c", "reference/*.c")
LONGEST_WATCHDOG = 4.0  # [s]: ns in 32 bits
COMPILERS = ("cc", "gcc", "clang")
MOTIONS = {"circle": "circle", "follow": "follow"}  # scripts of other names are waypoints


def compiled() -> Path:
    """The reference device's program, compiled into the user's cache if these sources never were.

    Raises ValueError, one sentence, where there are no sources or no C compiler, where the compiler refuses them, or
    where the cache cannot be written.
    """
    root = sources()
    program = _cache() / f"firmware-{_digest(root)}" / "reference_device"
    if program.is_file():
        program.parent.touch()  # the cache keeps what was used last
        return program
    compiler = _compiler()
    try:
        program.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=program.parent) as fresh:
            _compile(compiler, root, Path(fresh) / program.name)
            (Path(fresh) / program.name).replace(program)  # whole, or not there, for who compiles it too
    except OSError as error:
        raise ValueError(f"the reference device cannot be compiled: {in_words(error)}") from None
    return program


def sources() -> Path:
    """The folder firmware/: of the source tree, of a pip installation, of a colcon workspace, in that order.

    Raises ValueError if it is in none of them.
    """
    folders = list(places("firmware"))
    for folder in folders:
        if (folder / "haptic_core.c").is_file():
            return folder
    raise ValueError(f"the firmware's sources are not in {', '.join(map(str, folders))}")


def _cache() -> Path:
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "haptic_display"
    except RuntimeError:
        raise ValueError("nobody's home is known to keep the reference device in; set XDG_CACHE_HOME") from None


def _digest(root: Path) -> str:
    facts = hashlib.sha256()
    for folder in ("", "boards/host", "reference"):
        for file in sorted((root / folder).glob("*.[ch]")):
            facts.update(f"{file.relative_to(root)}\n".encode() + file.read_bytes())
    return facts.hexdigest()[:16]


def _compiler() -> list[str]:
    """The first of $CC and COMPILERS that is there, with the options that $CC may have."""
    candidates = [shlex.split(os.environ.get("CC", "")), *([name] for name in COMPILERS)]
    for candidate in candidates:
        if candidate and shutil.which(candidate[0]):
            return candidate
    looked = f"$CC, {', '.join(COMPILERS)}"
    raise ValueError(f"the reference device needs a C compiler ({looked}); install one (Debian, Ubuntu: gcc)")


def _compile(compiler: list[str], root: Path, program: Path) -> None:
    files = [str(file) for pattern in SOURCES for file in sorted(root.glob(pattern))]
    command = [*compiler, "-std=c99", "-O2", "-o", str(program), *files, "-lm"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = done.stderr.splitlines()
        first = next((line for line in said if "error" in line), said[0] if said else f"exit {done.returncode}")
        raise ValueError(f"{compiler[0]} does not compile the reference device: {first.strip()}")


def config_of(device: Device, values: dict[str, Any]) -> str:
    """The reference device's config file for a described device, and a hand of these loopback parameter values.

    motion.* is in the world; the file is in the device's own units. Raises ValueError where the script is wrong, the
    device is a linkage, or the watchdog is longer than the protocol can say.
    """
    if device.joints:
        raise ValueError(f"device {device.name} is a {device.kinematics.type}; the reference device moves axes only")
    if (given := values["motor_watchdog"]) > LONGEST_WATCHDOG:
        raise ValueError(f"motor_watchdog is {given:g} s; the reference device stands {LONGEST_WATCHDOG:g} s at most")
    scale = np.array([device.scale[0], device.scale[0], device.scale[1]])
    there = np.arange(3) < len(device.axes)
    lines = [*_mechanism(device), *_hand(values, there, scale)]
    return "\n".join([*lines, f"watchdog {given!r}", ""])


def _mechanism(device: Device) -> Iterator[str]:
    name = "".join(one if one.isprintable() and one != "#" else "?" for one in device.name.strip())
    yield f"name {name.encode('ascii', 'replace')[:24].decode() or 'unnamed'}"
    yield f"axes {len(device.axes)}"
    last = device.axes[-1]
    axes = [*device.axes, *[last] * (3 - len(device.axes))]  # what the device lacks is not looked at
    for key in (
        *("mass", "damping", "coulomb", "counts_per_unit", "encoder_sign", "zero"),
        *("motor_constant", "motor_sign", "motor_limit"),
    ):
        yield _line(key, (getattr(axis, key) for axis in axes))
    yield _line("gravity", (*device.gravity, 0.0))
    yield f"sensing_delay {device.sensing_delay!r}"
    yield f"actuation_delay {device.actuation_delay!r}"


def _hand(values: dict[str, Any], there: Any, scale: Any) -> Iterator[str]:
    script, name = operator_hand.script(values), values["motion.name"]
    for part in ("mass", "damping", "stiffness"):
        plane = values[f"hand.{part}"]
        yield _line(f"hand_{part}", (plane, plane, values[f"hand.rotational_{part}"]))
    yield _line("start", np.where(there, values["motion.start"], 0.0) / scale)
    yield f"motion {MOTIONS.get(name, 'waypoints')}"
    if name == "circle":
        yield f"radius {float(values['motion.radius'] / scale[0])!r}"
        yield f"turns {values['motion.turns']!r}"
        yield f"duration {values['motion.duration']!r}"
    elif name == "follow":
        yield f"lag {values['motion.lag']!r}"
    else:
        for i in range(int(script["count"][0])):
            place = np.where(there, script["points"][0, i], 0.0) / scale
            yield _line("waypoint", (script["times"][0, i], *place, script["grip"][0, i]))


def _line(key: str, numbers: Iterable[float]) -> str:
    return " ".join([key, *(repr(float(number)) for number in numbers)])
