# SPDX-License-Identifier: Apache-2.0
"""`haptic compile`: kernels into the cache, so that no later start compiles any."""

import fcntl
import gc
import multiprocessing
import os
import signal
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Annotated

import typer

from haptic_device import jit
from haptic_device.process import die_with_parent, say
from haptic_display.cli.progress import status_line
from haptic_display.cli.words import next_step

TEXT = "compiling, once for this machine"
MACHINE = BrokenProcessPool, MemoryError, OSError  # memory or the disk failed: no fault of the cache
LOOK, SELDOM = 1.0, 10.0  # [s] between looks at what is done, and between lines where there is no terminal


def compile(entries: Annotated[list[str] | None, typer.Argument(help="Some only; all by default.")] = None) -> None:
    """Compile kernels for this machine, on all cores; make setup does so. Ctrl-C keeps what is done.

    All are read again too, if none is named.
    """
    from haptic_display.run.kernels import ENTRIES

    if strangers := sorted({*(entries or ())} - {*ENTRIES}):
        raise ValueError(f"no kernels are called {', '.join(strangers)}; there are {', '.join(ENTRIES)}")
    if jit.note():
        say(jit.note())
    with open(jit.folder() / "compiling", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # what one process compiles another need not
        known = any(jit.folder().rglob("*.nbi"))
        names = jit.missing([name for name in ENTRIES if name in entries]) if entries else [*ENTRIES]
        wrong = _compile(names)
        if wrong and known:
            say(f"compiled kernels in {jit.folder()} cannot be read ({'; '.join(wrong)}); all are compiled anew")
            jit.wipe()
            wrong = _compile([*ENTRIES])
    if wrong:
        raise ValueError(f"not compiled: {'; '.join(wrong)}")
    typer.echo(f"{'all' if not entries else 'these'} kernels are compiled; they are kept in {jit.folder()}")
    if not entries and "MAKELEVEL" not in os.environ:  # else it is a step of something, which knows what is next
        next_step("haptic demo --view")


def _compile(names):
    """Sentences on those of these entries that could not be compiled. Raises ValueError where the machine stops one."""
    if not names:
        return []
    wrong, began, own = [], time.time(), multiprocessing.get_context("spawn")
    workers = min(len(names), len(os.sched_getaffinity(0)))
    with status_line(SELDOM) as show, ProcessPoolExecutor(workers, own, _begin, (os.getpid(),)) as pool:
        try:
            names = {pool.submit(_entry, name): name for name in names}
            left = {*names}
            while left:
                done, left = wait(left, LOOK, FIRST_COMPLETED)
                failed = [(names[one], error) for one in done if (error := one.exception())]
                wrong += [f"{name} ({type(error).__name__}: {error})" for name, error in failed]
                if any(isinstance(error, MACHINE) for _, error in failed):
                    raise ValueError(f"not compiled: {'; '.join(wrong)}")
                if good := [names[one] for one in done if not one.exception()]:
                    jit.record(good)
                show(f"{TEXT}: {_kept(began)} kernels, {len(names) - len(left)} of {len(names)} groups")
        except BaseException:  # interrupted: at once, also in the middle of LLVM; the cache has whole files only
            for worker in multiprocessing.active_children():
                worker.kill()
            raise
    return wrong


def _kept(began):
    """How many kernels numba has written since then: each, once compiled, is a file of its own."""
    return sum(file.stat().st_mtime >= began for file in jit.folder().rglob("*.nbc"))


def _begin(parent):
    """A worker ends with whoever started it, and leaves Ctrl-C to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(100_000)  # numba makes many objects that stay: a tenth of the time
    die_with_parent(parent)


def _entry(name):
    from haptic_display.run.kernels import ENTRIES

    ENTRIES[name]()
