# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels: never a stale law, and the same arithmetic without the compiler."""

import ast
import os
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numba
import numpy as np
import pytest

from haptic_device.cache import BESIDE, ROOMS
from haptic_device.law import servo
from haptic_device.whole import PLAIN

pytestmark = pytest.mark.timeout(600)

ROOT = Path(__file__).resolve().parents[2]


def python(script, cwd=ROOT, **environment):
    environment = {**os.environ, "PYTHONPATH": f"{cwd}:{ROOT / 'test'}", **environment}
    command = [sys.executable, "-c", textwrap.dedent(script)]
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.fixture
def tree(tmp_path):
    """A copy of the packages, with a cache of its own."""
    for package in ("haptic_device", "haptic_sim"):
        shutil.copytree(ROOT / package, tmp_path / "tree" / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "tree"


def test_a_kernel_is_loaded_without_scipys_linear_algebra_which_can_be_imported_all_the_same():
    said = python("""
        import sys
        from haptic_device.law import passivity
        assert passivity.least_damping(1000.0, 1.0, 1e-3, 0.0) == 1.5
        print("scipy.linalg" in sys.modules)
        import scipy.linalg.cython_blas
        print(sys.modules["scipy.linalg.cython_blas"] is not None)
    """)
    assert said == ["False", "True"]


@pytest.mark.parametrize("name", ["haptic_device/operating.py", "haptic_device/law/wall.py"])
def test_after_an_edit_of_what_decides_which_kernels_there_are_nothing_is_said_to_be_compiled(tree, name):
    ask = "from haptic_device import cache; print(cache.stamp())"
    before = python(ask, tree)
    assert python(ask, tree) == before
    os.utime(tree / name, (1.0, 1.0))
    assert python(ask, tree) != before


ASK = """
    import numpy as np
    from haptic_device import cache
    from haptic_device.runtime import zwidth_cell
    setup = np.zeros(1, zwidth_cell.CELL)
    setup["resolution"] = 1.0
    reading = zwidth_cell._read(setup.view(np.recarray)[0], 6.2)  # by law/encoder.py, which is a part of it
    print(cache.__file__, cache.sources_digest(), cache.FOLDER, reading)
"""


def test_an_edited_law_is_compiled_anew_and_an_old_one_is_never_run(tree, tmp_path):
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    before = python(ASK, tree, **cache)
    assert before[0].startswith(str(tree)) and before[2].startswith(str(tmp_path / "cache")) and before[3] == "6.0"
    assert python(ASK, tree, **cache) == before
    law = tree / "haptic_device/law/encoder.py"
    law.write_text(law.read_text().replace("return counts * position", "return 2.0 * counts * position"))
    after = python(ASK, tree, **cache)
    assert after[1] != before[1] and after[2] != before[2] and after[3] == "12.0"


DIGEST = "from haptic_device import cache; print(cache.sources_digest())"


@pytest.mark.parametrize("source", ["haptic_device/runtime/loop.py", *BESIDE])
def test_any_source_that_can_reach_a_kernel_changes_the_digest(tree, tmp_path, source):
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    before = python(DIGEST, tree, **cache)
    (tree / source).write_text((tree / source).read_text() + "\n")
    assert python(DIGEST, tree, **cache) != before


def kernels_in(file):
    """The kernels of a source file, and {name: module} of what it imports from other files of the project."""
    tree = ast.parse(file.read_text())
    imports = {name.asname or name.name: node.module for node in tree.body if isinstance(node, ast.ImportFrom)
               for name in node.names if node.module.startswith("haptic_")}  # fmt: skip
    decorated = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.decorator_list]
    return decorated, imports


@pytest.mark.parametrize("file", [name for room in ROOMS for name in sorted((ROOT / room).glob("*.py"))],
                         ids=lambda file: file.name)  # fmt: skip
def test_whatever_a_kernel_takes_from_another_file_is_of_a_source_in_the_digest(file):
    kernels, imports = kernels_in(file)
    taken = {node.id for kernel in kernels for line in kernel.body for node in ast.walk(line)
             if isinstance(node, ast.Name)} & set(imports)  # fmt: skip
    for name in taken:
        source = imports[name].replace(".", "/")
        assert source.startswith(ROOMS) or f"{source}.py" in BESIDE, f"{file.name}: {name} of {imports[name]}"


def test_folders_of_old_sources_are_removed_and_the_own_one_stays(tmp_path):
    for i in range(9):
        old = tmp_path / "haptic_display" / f"old{i}"
        old.mkdir(parents=True)
        os.utime(old, (i, i))
    [own] = python("from haptic_device import cache; print(cache.FOLDER)", XDG_CACHE_HOME=str(tmp_path))
    left = {path.name for path in (tmp_path / "haptic_display").iterdir()}
    assert Path(own).name in left and len(left) == 4
    assert "old0" not in left and "old8" in left


LOCKSTEP = """
    import numpy as np
    from lockstep_systems import device, values
    from haptic_device import operating
    from haptic_device.law import plant, servo
    from haptic_device.runtime import loop

    described = device(1.0, 2e5, 0.02)
    wall = dict(wall__normals=(0.8, 0.6), wall__offsets=(0.0,), wall__stiffness=(4000.0,), wall__damping=(0.2,))
    settings = operating.settings_from(described, values("haptic_driver", **wall, engage__time=0.01,
        coupling__stiffness=0.0, coupling__damping=0.0, cancellation__ratio=0.5))
    body, memory, motion = operating.hand_from(described, values("haptic_loopback", motion__name="press_wall",
        motion__start=(-0.0002, 0.0, 0.0), motion__target=(-0.01, -0.005, 0.0), motion__duration=0.1))
    memory["time"] = start = 1_000_000_000
    state, rows, tool = np.zeros(1, servo.MEMORY), np.zeros(100, servo.TICK), np.zeros(1, loop.TOOL)
    records = [array.view(np.recarray) for array in (settings, state, rows, tool, body, memory, motion)]
    loop.run_lockstep(*records, start, 0, 5000, 1)
    rows.tofile(OUT)
"""


def test_without_the_compiler_the_same_servo_and_plant_compute_the_same(tmp_path):
    results = []
    for disabled in ("0", "1"):
        out = tmp_path / disabled
        python(f"OUT = {str(out)!r}\n" + textwrap.dedent(LOCKSTEP), NUMBA_DISABLE_JIT=disabled)
        results.append(np.fromfile(out, servo.TICK))
    compiled, plain = results
    assert np.abs(compiled["force_walls"]).max() > 0.1 and compiled["engage"][-1] == 1.0
    for name in servo.TICK.names:
        assert np.allclose(compiled[name], plain[name], rtol=1e-9, atol=1e-12), name


@njit
def scaled(x, factor):
    return factor * x


@njit
def sum_of(x, count):
    total = 0.0
    for k in range(count):
        total += scaled(x, k)
    return total + scaled(x, 0) + scaled(x, 1)


@kernel
def twice(x):
    return sum_of(x, 3) + sum_of(x, 3)


def test_the_installed_numba_is_one_that_parts_were_tested_with():
    assert PLAIN == ""


PLAINLY = """
    import sys
    if LACKING:
        import numba.core.codegen
        del numba.core.codegen.JITCodeLibrary
    if OTHER:
        import numba
        numba.__version__ = "9.1.0"
    from haptic_device import whole
    from haptic_device.law import wall
    print(whole.PLAIN)
    print(wall.wall_depth(1.0, 0.0, 0.0, -0.25, 0.0))
"""


@pytest.mark.parametrize(
    ("lacking", "other", "wanted", "why"),
    [
        (True, False, "", "numba 0.68.1 lacks an inner part"),
        (False, True, "", "numba 9.1.0 is not one of the known versions"),
        (False, False, "1", "HAPTIC_PLAIN_KERNELS is set"),
    ],
)
def test_an_unknown_numba_or_one_that_lacks_a_part_compiles_plainly_and_says_why(tmp_path, lacking, other, wanted, why):
    script = f"LACKING, OTHER = {lacking}, {other}\n" + textwrap.dedent(PLAINLY)
    said = python(script, XDG_CACHE_HOME=str(tmp_path), HAPTIC_PLAIN_KERNELS=wanted)
    assert " ".join(said[:-1]).startswith(why.replace("0.68.1", numba.__version__))
    assert abs(float(said[-1])) == 0.25


def test_compiled_plainly_or_as_one_kernels_give_the_same_bits():
    done = subprocess.run([sys.executable, "bench/plain_njit.py", "--short"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 calculations, 0 with other bits" in done.stdout.replace("  ", " ")


def test_a_whole_computes_with_its_parts_and_compiles_each_once_for_all_integers():
    assert twice(1.5) == 2.0 * (1.5 * 3.0 + 1.5)
    twice.recompile()  # the first call may have come from the cache
    assert len(scaled.signatures) == len(sum_of.signatures) == 1


@numba.njit
def outside(x):
    return sum_of(x, 3)


def test_a_function_that_knows_nothing_of_parts_takes_in_those_below_a_part_too():
    assert outside(1.5) == 1.5 * 3.0 + 1.5


def test_a_part_has_no_machine_code_and_says_so():
    assert twice(0.0) == 0.0
    with pytest.raises(TypeError, match="not callable"):
        scaled(1.0, 2)
