# SPDX-License-Identifier: Apache-2.0
"""The firmware as tests compile it, each part once a process, with all warnings as errors."""

import atexit
import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIRMWARE, PORTS = ROOT / "firmware", ROOT / "test/firmware"
STRICT = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror"]
SANITIZED = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
CORE = [FIRMWARE / name for name in ("haptic_core.c", "haptic_frame.c", "haptic_main.c")]
PLANT = [FIRMWARE / "reference" / name for name in ("plant.c", "hand.c")]


@functools.cache
def folder() -> Path:
    """Where they are, until this process ends."""
    made = Path(tempfile.mkdtemp(prefix="haptic_firmware_"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def _compiled(name, *words) -> Path:
    command = [*STRICT, *map(str, words), f"-I{FIRMWARE}", "-lm", "-o", str(folder() / name)]
    subprocess.run(command, check=True)
    return folder() / name


@functools.cache
def device() -> Path:
    """The reference device, under sanitizers."""
    host = [*sorted(FIRMWARE.glob("boards/host/*.c")), *sorted(FIRMWARE.glob("reference/*.c"))]
    return _compiled("device", *SANITIZED, *CORE, *host)


@functools.cache
def fuzzer() -> Path:
    """test/firmware/fuzz_core.c, under sanitizers."""
    return _compiled("fuzz", *SANITIZED, PORTS / "fuzz_core.c", *CORE[:2])


@functools.cache
def page_tool(*options) -> Path:
    """test/page_tool.c, under sanitizers."""
    return _compiled("_".join(["page_tool", *options]), *SANITIZED, *options, ROOT / "test/page_tool.c")


@functools.cache
def ports() -> ctypes.CDLL:
    """Core, plant and hand, and the functions of test/firmware/*_port.c by which tests reach them."""
    library = ctypes.CDLL(str(_compiled("ports.so", "-O1", "-shared", "-fPIC", *PORTS.glob("*_port.c"), *CORE, *PLANT)))
    for name in ("port_due", "plant_port_push", "plant_port_time"):
        getattr(library, name).restype = ctypes.c_int64
    library.haptic_crc32.restype = ctypes.c_uint32
    return library


def objects() -> list[Path]:
    """The core's three objects, as a board's build makes them."""
    return [_compiled(f"{file.stem}.o", "-O2", "-c", file) for file in CORE]
