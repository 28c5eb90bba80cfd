# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels: whose cache they are in, what if it is damaged, and the same arithmetic without the compiler."""

import errno
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from haptic_device import jit
from haptic_device.control import records

pytestmark = pytest.mark.timeout(600)

ROOT = Path(__file__).resolve().parents[2]


def python(script, cwd=ROOT, **environment):
    """(words of standard output, standard error) of a script that ends well."""
    known = {**os.environ, "PYTHONPATH": f"{cwd}:{ROOT / 'test'}", **environment}
    known = {name: value for name, value in known.items() if value is not None}
    command = [sys.executable, "-P", "-c", textwrap.dedent(script)]
    done = subprocess.run(command, cwd=cwd, env=known, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


def test_whatever_a_kernel_may_be_made_of_changes_the_folder_and_a_command_or_a_page_does_not(tmp_path, monkeypatch):
    tree = tmp_path / "tree"
    for package in ("haptic_device", "haptic_display", "haptic_sim"):
        shutil.copytree(ROOT / package, tree / package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(jit, "ROOT", tree)
    before = jit.digest()
    for source in ("haptic_display/cli/demo.py", "haptic_display/page/commands.py", "haptic_display/cli/main.py"):
        os.utime(tree / source, (1.0, 1.0))
    assert jit.digest() == before
    for source in (
        "haptic_device/control/virtual_wall.py",
        "haptic_device/config/parameters.py",
        "haptic_display/run/kernels.py",
    ):
        os.utime(tree / source, (1.0, 1.0))
        assert jit.digest() != before
        before = jit.digest()


def test_folders_of_old_sources_are_removed_and_the_own_one_stays(tmp_path):
    for i in range(9):
        (tmp_path / f"old{i}").mkdir()
        os.utime(tmp_path / f"old{i}", (i, i))
    own = jit.made(tmp_path, "own")
    left = {path.name for path in tmp_path.iterdir()}
    assert own.name in left and len(left) == jit.KEPT
    assert "old0" not in left and "old8" in left


LOCKSTEP = """
    import numpy as np
    from lockstep_systems import device, values
    from haptic_device.control import controller_config
    from haptic_device.control.records import STATE, TRACE_ROW
    from haptic_device.device import loopback_config, simulated_device
    from haptic_device.realtime import servo_loop

    described = device(1.0, 2e5, 0.02)
    wall = dict(wall__normals=(0.8, 0.6), wall__offsets=(0.0,), wall__stiffness=(4000.0,), wall__damping=(0.2,))
    settings = controller_config.settings_from(described, values("haptic_driver", **wall, engage__time=0.01,
        coupling__stiffness=0.0, coupling__damping=0.0, cancellation__ratio=0.5))
    body, memory, motion = loopback_config.hand_from(described, values("haptic_loopback", motion__name="press_wall",
        motion__start=(-0.0002, 0.0, 0.0), motion__target=(-0.01, -0.005, 0.0), motion__duration=0.1))
    memory["time"] = start = 1_000_000_000
    state, rows, tool = np.zeros(1, STATE), np.zeros(100, TRACE_ROW), np.zeros(1, servo_loop.TOOL)
    records = [array.view(np.recarray) for array in (settings, state, rows, tool, body, memory, motion)]
    simulated_device.run_lockstep(*records, start, 0, 5000, 1)
    rows.tofile(OUT)
"""


def test_without_the_compiler_the_same_servo_and_plant_compute_the_same(tmp_path):
    script = f"OUT = {str(tmp_path / 'rows')!r}\n" + textwrap.dedent(LOCKSTEP)
    exec(script, {})
    compiled = np.fromfile(tmp_path / "rows", records.TRACE_ROW)
    python(script, NUMBA_DISABLE_JIT="1")
    plain = np.fromfile(tmp_path / "rows", records.TRACE_ROW)
    assert np.abs(compiled["force_walls"]).max() > 0.1 and compiled["engage"][-1] == 1.0
    for name in records.TRACE_ROW.names:
        assert np.allclose(compiled[name], plain[name], rtol=1e-9, atol=1e-12), name


def where(**environment):
    """(folder, sentence) of the cache of a process with this environment; None takes a variable away."""
    [folder, *note], _ = python("from haptic_device import jit; print(jit.folder(), jit.note())", **environment)
    return Path(folder), " ".join(note)


def test_a_cache_that_cannot_be_written_is_said_in_one_sentence_and_kernels_are_kept_in_memory(tmp_path):
    (tmp_path / "file").touch()
    folder, note = where(XDG_CACHE_HOME=str(tmp_path / "file"))
    assert folder.is_relative_to(jit.MEMORY) and folder.parent.stat().st_mode & 0o777 == 0o700
    assert note.startswith(f"{tmp_path}/file/haptic_display cannot hold the compiled kernels (Not a directory)")
    assert str(folder) in note


def test_without_home_and_cache_variables_there_is_a_cache_all_the_same():
    assert where(XDG_CACHE_HOME=None, HOME=None)[0].is_dir()


def test_a_disk_without_room_for_the_kernels_is_refused_before_anything_is_compiled_unless_they_are_there(
    tmp_path, monkeypatch
):
    (jit.made(tmp_path, "there") / f"servo{jit.DONE}").touch()
    monkeypatch.setattr(jit, "ROOM", 2**62)
    with pytest.raises(OSError) as refusal:
        jit.made(tmp_path, "digest")
    assert refusal.value.errno in (errno.ENOSPC, errno.EFBIG)
    assert jit.made(tmp_path, "there").is_dir()


def test_a_folder_that_others_can_write_or_a_link_is_no_place_for_code(tmp_path):
    for name, mode in (("all", 0o777), ("group", 0o750), ("own", 0o700)):
        (tmp_path / name).mkdir()
        (tmp_path / name).chmod(mode)
    (tmp_path / "link").symlink_to(tmp_path / "own")
    for name in ("all", "group", "link"):
        with pytest.raises(PermissionError, match="is another user's"):
            jit.private(tmp_path / name)
    jit.private(tmp_path / "own")
