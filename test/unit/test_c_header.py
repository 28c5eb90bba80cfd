# SPDX-License-Identifier: Apache-2.0
"""firmware/haptic_device.h and its example: they compile everywhere, and the example is a device as one should be."""

import re
import signal
import subprocess
import uuid

import firmware_builds
import pytest
from firmware_builds import FIRMWARE
from waiting import exit_code

from haptic_device.control import faults
from haptic_device.realtime import atomic, servo_writes, shared_memory
from haptic_device.realtime.hardware_interface import SharedMemoryInterface
from haptic_device.realtime.shared_memory import file_name
from haptic_display.device_tools import conformance

HEADER, EXAMPLE = FIRMWARE / "haptic_device.h", FIRMWARE / "examples/own_device.c"
STRICT = "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I", str(FIRMWARE)
DOMAIN = 7
OTHERWISE = {  # names that Python has otherwise
    "BYTES": 8 * shared_memory.WORDS,
    "DEVICE_BYTE": shared_memory.ROLE_BYTE[shared_memory.DEVICE],
    "SERVO_BYTE": shared_memory.ROLE_BYTE[shared_memory.SERVO],
    "ESTOP": faults.BUTTON,
    "ENCODER": faults.BROKEN_ENCODER,
    "SHORTEST_PERIOD": servo_writes.PERIODS[0],
    "LONGEST_PERIOD": servo_writes.PERIODS[1],
    "FOLDER": shared_memory.FOLDER,
}


def in_python(name):
    """What Python has for this name of the header."""
    if name in OTHERWISE:
        return OTHERWISE[name]
    return next(getattr(room, name) for room in (shared_memory, faults, atomic, servo_writes) if hasattr(room, name))


def compiled(source, folder, *options, compiler="gcc", standard="c99"):
    """The program made of this C."""
    made = folder / f"{source.stem}_{uuid.uuid4().hex}"
    language = {"gcc": "c", "g++": "c++"}[compiler]
    command = [compiler, f"-std={standard}", *STRICT, *options, "-o", str(made), "-x", language, str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    return made


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("c")


@pytest.fixture(scope="module")
def example(folder):
    """The example, which says at its end what force it leaves."""
    ending = folder / "ending.c"
    ending.write_text(
        f'#define main example\n#include "{EXAMPLE}"\n#undef main\n'
        "int main(int argc, char **argv)\n{\n    int code = example(argc, argv);\n"
        '    if (code == 0)\n        printf("left %g\\n", handle.force);\n    return code;\n}\n'
    )
    return compiled(ending, folder, "-Wconversion", *firmware_builds.SANITIZED)


def page(space):
    return shared_memory.FOLDER / file_name(DOMAIN, space)


def test_every_constant_of_the_header_is_that_of_the_page(folder):
    names = re.findall(r"^#define HAPTIC_(\w+) ", HEADER.read_text(), re.MULTILINE)
    names.remove("FOLDER")
    lines = "".join(f'    printf("%lld\\n", (long long)HAPTIC_{name});\n' for name in names)
    source = folder / "constants.c"
    source.write_text(
        f'#include "haptic_device.h"\nint main(void)\n{{\n    puts(HAPTIC_FOLDER);\n{lines}    return 0;\n}}\n'
    )
    said = subprocess.run([compiled(source, folder)], capture_output=True, text=True).stdout.split()
    assert dict(zip(["FOLDER", *names], said, strict=True)) == {n: str(in_python(n)) for n in ("FOLDER", *names)}


@pytest.mark.parametrize("compiler, standard", [("gcc", "c99"), ("gcc", "c17"), ("g++", "c++11"), ("g++", "c++20")])
def test_the_header_compiles_without_a_warning_in_c_and_in_cpp(folder, compiler, standard):
    source = folder / "alone.c"
    source.write_text(
        '#include "haptic_device.h"\nint main(void) { haptic_page p; return haptic_open(&p, "x", 0) != -1; }\n'
    )
    for level in ("-O0", "-O2"):
        program = compiled(source, folder, level, compiler=compiler, standard=standard)
        assert subprocess.run([program]).returncode == 0


def test_the_example_keeps_every_promise_of_a_link_and_ends_with_zero(start, example, space):
    process = start([example, str(DOMAIN), space], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == f"own_device: serves {page(space)}\n"
    interface = SharedMemoryInterface(page(space).name, 7)
    results = conformance.check_all(interface)
    conformance.drive(interface, 50, 15.0)  # it ends while it is pushed
    broken = [result for result in results if not result.passed and result.name != conformance.IN_TIME]
    assert len(results) == len(conformance.CHECKS) and not broken  # that one judges this machine too
    process.send_signal(signal.SIGTERM)
    assert exit_code(process) == 0 and process.stdout.read() == "left 0\n"
    interface.close()
    assert "runtime error" not in (said := process.stderr.read()) and "Sanitizer" not in said
