# SPDX-License-Identifier: Apache-2.0
"""Kernels are compiled once, whoever asks; interrupted in the middle nothing is left running."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from live_nodes import MODULES
from waiting import output, until

from haptic_device.jit import RECORD
from haptic_sim.kernels import ENTRIES

pytestmark = pytest.mark.timeout(1800)

ROOT = Path(__file__).resolve().parents[2]
SMALL = "wall maps"  # of few functions


def asking(cache_home, *names):
    """A process that has these entries in the cache when it ends; what was compiled is said by numba itself."""
    script = f"from haptic_device.jit import ensure_compiled; ensure_compiled(*{names!r})"
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache_home)}
    return subprocess.Popen(
        [sys.executable, "-c", script],
        cwd=ROOT,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def ended(process):
    """(standard output, standard error) of a process that ends well."""
    try:
        out, error = output(process)
    finally:
        process.kill()
    assert process.returncode == 0, error
    return out, error


def compiling(cache_home):
    """Processes that compile for this cache."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_text().split("\0")
            environment = (entry / "environ").read_text()
        except OSError:
            continue
        if str(cache_home) in environment and ("compile" in words or any("spawn_main" in word for word in words)):
            found.append(int(entry.name))
    return found


def test_two_that_ask_for_the_same_at_once_have_it_compiled_once(tmp_path):
    said = [ended(process)[1] for process in [asking(tmp_path, SMALL) for _ in range(2)]]
    assert sum("1 of 1" in text for text in said) == 1, said
    assert ended(asking(tmp_path, SMALL)) == ("", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_interrupted_in_the_middle_nothing_is_left_running_and_the_cache_still_serves(tmp_path, number):
    process = asking(tmp_path, "servo", "methods")
    until(lambda: len(compiling(tmp_path)) >= 3, "processes that compile")
    process.send_signal(number)
    until(lambda: not compiling(tmp_path), "the end of all that compiled")
    output(process)
    assert process.returncode == -number
    ended(asking(tmp_path, SMALL))
    assert ended(asking(tmp_path, SMALL)) == ("", "")


def test_the_command_ends_at_once_by_ctrl_c_and_so_do_its_workers(tmp_path):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-m", "haptic_sim.cli.main", "compile"]
    process = subprocess.Popen(command, cwd=ROOT, env=environment, text=True, stderr=subprocess.PIPE)
    until(lambda: len(compiling(tmp_path)) >= 3, "processes that compile")
    process.send_signal(signal.SIGINT)
    said = output(process)[1]
    assert process.returncode == 130 and "Traceback" not in said, said
    until(lambda: not compiling(tmp_path), "the end of all that compiled")


@pytest.mark.parametrize("module", MODULES.values())
def test_a_node_told_to_end_while_its_kernels_compile_ends_well_and_so_does_all_that_compiled(tmp_path, start, module):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    node = start([sys.executable, "-m", module], env=environment, stderr=subprocess.PIPE)
    until(lambda: len(compiling(tmp_path)) >= 2, "a process that compiles")
    node.send_signal(signal.SIGTERM)
    said = output(node)[1]
    assert node.returncode == 0 and "Traceback" not in said, said
    until(lambda: not compiling(tmp_path), "the end of all that compiled")
    assert not list(tmp_path.rglob(RECORD))


def test_what_two_entries_keep_they_keep_for_the_same_types(tmp_path):
    """Two processes that keep other types of one kernel at the same moment would mix them up: numba locks nothing."""
    kept = {}
    for name in ENTRIES:
        ended(asking(tmp_path / name, name))
        kept[name] = {path.name.split(".py3")[0] for path in (tmp_path / name).rglob("*.nbi")}
    ended(asking(tmp_path / "all", *ENTRIES))
    several = {path.name.split(".py3")[0] for path in (tmp_path / "all").rglob("*.2.nbc")}
    shared = {kernel: [name for name in ENTRIES if kernel in kept[name]] for kernel in several}
    assert {kernel: names for kernel, names in shared.items() if len(names) > 1} == {}
