# SPDX-License-Identifier: Apache-2.0
"""Kernels are compiled once, whoever asks, and never stale; interrupted in the middle nothing is left running."""

import os
import shutil
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from live_nodes import MODULES
from waiting import output, until

from haptic_device.jit import DONE
from haptic_display.run.kernels import ENTRIES

pytestmark = pytest.mark.timeout(1800)

ROOT = Path(__file__).resolve().parents[2]
SMALL = "wall maps"  # of few functions


def running(script, cache_home, cwd=ROOT, sources=ROOT):
    """A process that runs this script with the packages in `sources`; what was compiled is said by numba itself."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache_home), "PYTHONPATH": str(sources)}
    return subprocess.Popen(
        [sys.executable, "-P", "-c", textwrap.dedent(script)],
        cwd=cwd,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def asking(cache_home, *names, **places):
    """A process that has these entries in the cache when it ends."""
    return running(f"from haptic_device.jit import ensure_compiled; ensure_compiled(*{names!r})", cache_home, **places)


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
    assert sum("compiling, once" in text for text in said) == 1, said
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


@pytest.mark.parametrize("module", MODULES.values())
def test_a_node_told_to_end_while_its_kernels_compile_ends_well_and_so_does_all_that_compiled(tmp_path, start, module):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    node = start([sys.executable, "-m", module], env=environment, stderr=subprocess.PIPE)
    until(lambda: len(compiling(tmp_path)) >= 2, "a process that compiles")
    node.send_signal(signal.SIGTERM)
    said = output(node)[1]
    assert node.returncode == 0 and "Traceback" not in said, said
    until(lambda: not compiling(tmp_path), "the end of all that compiled")
    assert not list(tmp_path.rglob(f"*{DONE}"))


DAMAGE = {
    "nbc": lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]),
    "nbi": lambda file: file.write_bytes(b""),
}


@pytest.mark.parametrize("suffix", DAMAGE)
def test_what_numba_cannot_read_is_said_in_a_sentence_and_made_anew(tmp_path, suffix):
    ended(asking(tmp_path, SMALL))
    [done] = tmp_path.rglob(f"{SMALL}{DONE}")
    done.unlink()
    DAMAGE[suffix](next(tmp_path.rglob(f"wall_tapping.cells-*.{suffix}")))
    assert "cannot be read (wall maps (" in ended(asking(tmp_path, SMALL))[1]
    assert ended(asking(tmp_path, SMALL)) == ("", "")


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


ASK = """
    import numpy as np
    from haptic_device import jit
    from haptic_device.device import wall_tapping
    setup = np.zeros(1, wall_tapping.CELL)
    setup["resolution"] = 1.0
    reading = wall_tapping._read(setup.view(np.recarray)[0], 6.2)  # by control/velocity_estimator.py
    print(jit.__file__, jit.folder(), reading)
"""


def test_an_edited_law_is_compiled_anew_and_an_old_one_is_never_run(tmp_path):
    tree, cache = tmp_path / "tree", tmp_path / "cache"
    for package in ("haptic_device", "haptic_sim"):
        shutil.copytree(ROOT / package, tree / package, ignore=shutil.ignore_patterns("__pycache__"))

    def said():
        return ended(running(ASK, cache, tree, tree))[0].split()

    before = said()
    assert before[0].startswith(str(tree)) and before[1].startswith(str(cache)) and before[2] == "6.0"
    assert said() == before
    law = tree / "haptic_device/control/velocity_estimator.py"
    law.write_text(law.read_text().replace("return counts * position", "return 2.0 * counts * position"))
    after = said()
    assert after[1] != before[1] and after[2] == "12.0"


def test_who_needs_kernels_that_are_not_there_has_them_compiled_in_sight_and_the_next_finds_them(tmp_path):
    (tmp_path / "haptic_device").mkdir()  # in the current folder lies another package of this name
    (tmp_path / "haptic_device/__init__.py").write_text("raise ImportError('the wrong package')\n")
    assert "compiling, once for this machine: " in ended(asking(tmp_path / "cache", SMALL, cwd=tmp_path))[1]
    assert ended(asking(tmp_path / "cache", SMALL, cwd=tmp_path)) == ("", "")
