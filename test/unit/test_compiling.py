# SPDX-License-Identifier: Apache-2.0
"""Kernels are compiled once, by processes of their own, whoever asks; where they cannot be kept they still run."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from live_nodes import MODULES

from haptic_device import cache, compiling

pytestmark = pytest.mark.timeout(600)

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 100.0  # s
SMALL = "wall maps"  # of few functions


def asking(cache_home, *names):
    """A process that has these groups in the cache when it ends; what was compiled is said by numba itself."""
    script = f"from haptic_device.compiling import have; have(*{names!r})"
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache_home), "NUMBA_DEBUG_CACHE": "1"}
    environment["PYTHONUNBUFFERED"] = "1"  # a worker that is ended takes with it what it has not written out
    return subprocess.Popen(
        [sys.executable, "-c", script], cwd=ROOT, env=environment, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip


def ended(process):
    """(standard output, standard error) of a process that ends well."""
    try:
        out, error = process.communicate(timeout=LIMIT)
    finally:
        process.kill()
    assert process.returncode == 0, error
    return out, error


def session(process):
    """Processes whose session is that of `process`, or of what it started, by the words of their command lines."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_text().split("\0")
            environment = (entry / "environ").read_text()
        except OSError:
            continue
        if process.cache in environment and "haptic_device.compiling" in words:
            found.append(int(entry.name))
    return found


def until(condition, what):
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end, f"{what} did not come within {LIMIT} s"
        time.sleep(0.02)


def test_two_that_ask_for_the_same_at_once_have_it_compiled_once_and_the_next_finds_it(tmp_path):
    asked = [asking(tmp_path, SMALL) for _ in range(2)]
    said = [ended(process)[1] for process in asked]
    saved = [line for text in said for line in text.splitlines() if "data saved to" in line and "zwidth_cell" in line]
    assert len(saved) == 1, said
    assert any(compiling.TEXT in text for text in said) and not any("of 0" in text for text in said)
    assert ended(asking(tmp_path, SMALL)) == ("", "")


def test_what_one_asks_for_while_another_compiles_is_compiled_along_with_it(tmp_path):
    asked = [asking(tmp_path, name) for name in (SMALL, "identification")]
    for process in asked:
        ended(process)
    assert ended(asking(tmp_path, SMALL, "identification")) == ("", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_interrupted_in_the_middle_nothing_is_left_running_and_the_cache_still_serves(tmp_path, number):
    process = asking(tmp_path, "servo", "methods")
    process.cache = str(tmp_path)
    until(lambda: len(session(process)) >= 2, "a process that compiles")
    process.send_signal(number)
    until(lambda: not session(process), "the end of all that compiled")
    process.communicate(timeout=LIMIT)
    assert process.returncode == -number
    ended(asking(tmp_path, SMALL))
    assert ended(asking(tmp_path, SMALL)) == ("", "")


@pytest.mark.parametrize("module", MODULES.values())
def test_a_node_told_to_end_while_its_kernels_compile_ends_well_and_so_does_all_that_compiled(tmp_path, start, module):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    node = start([sys.executable, "-m", module], env=environment, stderr=subprocess.PIPE)
    node.cache = str(tmp_path)
    until(lambda: len(session(node)) >= 2, "a process that compiles")
    node.send_signal(signal.SIGTERM)
    said = node.communicate(timeout=LIMIT)[1]
    assert node.returncode == 0 and "Traceback" not in said, said
    until(lambda: not session(node), "the end of all that compiled")
    assert compiling.TEXT in said and not list(tmp_path.rglob("*.done"))


def test_what_is_compiled_is_of_the_package_that_asks_not_of_one_in_the_current_folder(tmp_path):
    (tmp_path / "haptic_device").mkdir()
    (tmp_path / "haptic_device/__init__.py").write_text("raise ImportError('the wrong package')\n")
    script = f"from haptic_device import compiling as c; c.have('{SMALL}'); print(c.missing(['{SMALL}']))"
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-P", "-c", script]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=LIMIT)
    assert done.stdout == "[]\n", done.stderr


def test_groups_that_do_not_exist_are_refused_in_a_sentence(capsys):
    assert compiling.main(["servo", "serfo"]) == 1
    assert capsys.readouterr().err.startswith("no kernels are called serfo; there are methods, ")


UNHEARD = f"""
from haptic_device import compiling
compiling.GROUPS = ("unheard of",), ("{SMALL}",)
print(*compiling.compile_groups(compiling.names(), lambda progress: None))
print(*compiling.missing(compiling.names()))
"""


def test_a_group_that_cannot_be_compiled_is_named_and_the_others_are_there(tmp_path):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    command = [sys.executable, "-c", UNHEARD]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LIMIT)
    assert done.stdout.splitlines() == ["unheard of: ValueError: no kernels are called unheard of", "unheard of"]


def test_every_group_has_one_function_and_every_function_is_of_a_group():
    import haptic_device.node.kernels as device
    import haptic_sim.kernels as simulation

    assert sorted(compiling.names()) == sorted([*device.GROUPS, *simulation.GROUPS])


ASK = "from haptic_device import cache; print(cache.FOLDER); print(cache.NOTE)"


def where(**environment):
    """(folder, sentence) of the cache of a process with this environment; None takes a variable away."""
    known = {**os.environ, **environment}
    known = {name: value for name, value in known.items() if value is not None}
    command = [sys.executable, "-c", ASK]
    done = subprocess.run(command, cwd=ROOT, env=known, capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == 0, done.stderr
    folder, note = done.stdout.splitlines()
    return Path(folder), note


def test_a_cache_that_cannot_be_written_is_said_in_one_sentence_and_kernels_are_kept_in_memory(tmp_path):
    (tmp_path / "file").touch()
    folder, note = where(XDG_CACHE_HOME=str(tmp_path / "file"))
    assert folder.is_relative_to(cache.MEMORY) and folder.parent.stat().st_mode & 0o777 == 0o700
    assert note.startswith(f"{tmp_path}/file/haptic_display cannot hold the compiled kernels (Not a directory)")
    assert str(folder) in note


def test_without_home_and_cache_variables_there_is_a_cache_all_the_same(tmp_path):
    folder, _ = where(XDG_CACHE_HOME=None, HOME=None)
    assert folder.is_dir()


def test_a_disk_without_room_for_the_kernels_is_refused_before_anything_is_compiled(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "ROOM", 2**62)
    with pytest.raises(OSError) as refusal:
        cache._made(tmp_path, "digest")
    assert refusal.value.errno in (errno.ENOSPC, errno.EFBIG)


def test_kernels_that_are_there_already_serve_though_the_disk_is_full_now(tmp_path, monkeypatch):
    folder = cache._made(tmp_path, "digest")
    (folder / "servo-0123.done").touch()
    monkeypatch.setattr(cache, "ROOM", 2**62)
    assert cache._made(tmp_path, "digest") == folder


@pytest.mark.parametrize("mode", [0o777, 0o750])
def test_a_folder_that_others_can_write_is_no_place_for_code(tmp_path, mode):
    folder = tmp_path / "memory"
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(PermissionError, match="is another user's"):
        cache._private(folder)


def test_a_link_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / "memory").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(PermissionError):
        cache._private(tmp_path / "memory")
