# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels: numba with the project's options, a cache that cannot hold a stale law, and how it is filled.

numba's own cache looks only at the file of the function that was called; an edit of a law in another file would go
unseen. Here the cache folder's name is a digest of the package's sources, of when and where they were written (numba
looks at these), of numba, of python and of the CPU: any change is a new folder.

Compiling takes all of a core for many seconds, and some hundred MB that stay. `haptic compile` does it in processes of
its own; `ensure_compiled(...)` runs that command where an entry (of haptic_display/run/kernels.py) is missing there.
"""

import contextlib
import functools
import hashlib
import os
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding

from haptic_device.process import ending_with_us, held, own_environment, running_module

ROOT = Path(__file__).resolve().parent.parent
SOURCES = {"haptic_device": "*.py", "haptic_sim": "*.py", "haptic_display/run": "kernels.py"}  # that kernels need
DONE = ".done"  # ends the name of an empty file for each entry that is in the cache
KEPT = 4  # folders; older ones are removed
ROOM = 32 * 2**20  # bytes that must be free: all kernels take less
MEMORY = Path("/dev/shm")  # where kernels are kept until the next restart if the user's cache cannot be written
LOOK = 0.1  # [s] between looks at whether a process that waits shall end
END = 2.0  # [s] for an interrupted `haptic compile` to end by itself


def njit(function: Any, **options: Any) -> Any:
    """As numba.njit, for a function that kernels call. Division by zero follows IEEE 754, nothing raises."""
    import numba  # .4 s, which a process that calls no kernel does without

    options = {"no_cfunc_wrapper": True, **options}  # only a function pointer needs it
    return numba.njit(function, nogil=True, error_model="numpy", **options)


def inlined(function: Callable[..., Any]) -> Any:
    """As njit, for a function of some lines, or one whose constants numba would compile it anew for: it is taken into
    its callers before their types are inferred."""
    return njit(function, inline="always")


def kernel(function: Any) -> Any:
    """As njit, for a function that Python calls, in a test at least: kept in the cache.

    Given a signature in place of the function, a decorator that compiles for it at once, into a function pointer. Two
    entries must not need it for different types: numba does not lock what it writes (test/soak/test_compiling.py).
    """
    import numba

    numba.config.CACHE_DIR = str(folder())  # type: ignore[attr-defined]  # numba makes it when it is imported
    return njit(function, cache=True, no_cfunc_wrapper=callable(function))


def ensure_compiled(*entries: str, told: Sequence[int] = ()) -> None:
    """Returns when these entries are in the cache; `haptic compile`, a process of its own, compiles what is not there.

    What cannot be compiled there is compiled here when it is called, which then says why. KeyboardInterrupt as soon as
    there is anything in `told`, where somebody notes that this process shall end.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0" or not (left := missing(entries)):
        return
    command = ending_with_us([*running_module("haptic_display.cli.main"), "compile", *left])
    none = subprocess.DEVNULL
    with contextlib.ExitStack() as ending:
        with held():
            process = subprocess.Popen(command, stdin=none, stdout=none, start_new_session=True, env=own_environment())
            ending.callback(_end, process)
        while process.poll() is None and not told:
            time.sleep(LOOK)
    if told:
        raise KeyboardInterrupt


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ends a `haptic compile` that still runs: interrupted, it puts the terminal's cursor back."""
    process.send_signal(signal.SIGINT)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(END)
    process.kill()
    process.wait()


def missing(entries: Iterable[str]) -> list[str]:
    """Those of these entries that are not in the cache."""
    return [entry for entry in entries if not (folder() / f"{entry}{DONE}").exists()]


def record(entries: list[str]) -> None:
    """Notes that these entries are in the cache too, once they would outlast a loss of power."""
    os.sync()
    for entry in entries:
        (folder() / f"{entry}{DONE}").touch()


def wipe() -> None:
    """Takes all kernels out of the folder; others may write into it meanwhile."""
    for kept in (*folder().glob(f"*{DONE}"), *folder().rglob("*.nb[ic]")):
        kept.unlink(missing_ok=True)


def folder() -> Path:
    """This code's own folder of kernels; made when it is first needed, older ones removed."""
    return _place()[0]


def note() -> str:
    """Why the folder is not in the user's cache, as a sentence; "" if it is."""
    return _place()[1]


@functools.cache
def _place() -> tuple[Path, str]:
    base, own = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache", "haptic_display"), digest()
    try:
        return made(base.expanduser(), own), ""
    except (OSError, RuntimeError) as error:  # RuntimeError: nobody's home is known
        why = getattr(error, "strerror", None) or error
    try:
        place = made(private(MEMORY / f"haptic_display_{os.geteuid()}"), own)
    except OSError:
        place = Path(tempfile.mkdtemp(prefix="haptic_display_"))
    return place, f"{base} cannot hold the compiled kernels ({why}); they are kept in {place}"


def digest() -> str:
    """Of all that compiled kernels depend on; 16 hexadecimal digits."""
    facts = hashlib.sha256(repr((version("numba"), sys.version, llvmlite.binding.get_host_cpu_name())).encode())
    for folder, files in SOURCES.items():
        for source in sorted((ROOT / folder).rglob(files)):
            facts.update(f"{source} {source.stat().st_mtime_ns}".encode() + source.read_bytes())
    return facts.hexdigest()[:16]


def made(base: Path, name: str) -> Path:
    """The folder of this name, the newest of KEPT. OSError if it cannot be written or has no room."""
    own = base / name
    own.mkdir(parents=True, exist_ok=True)
    own.touch()
    with tempfile.TemporaryFile(dir=own) as file:
        if not any(own.glob(f"*{DONE}")):  # what is there already needs no room
            os.posix_fallocate(file.fileno(), 0, ROOM)
    with contextlib.suppress(FileNotFoundError):  # another process prunes too
        for old in sorted(base.glob("*/"), key=os.path.getmtime)[:-KEPT]:
            shutil.rmtree(old, ignore_errors=True)
    return own


def private(own: Path) -> Path:
    """A folder that only this user can write: what lies in a cache is run. PermissionError if it is another's."""
    own.mkdir(mode=0o700, exist_ok=True)
    known = own.lstat()
    if not stat.S_ISDIR(known.st_mode) or known.st_uid != os.geteuid() or known.st_mode & 0o077:
        raise PermissionError(f"{own} is another user's")
    return own
