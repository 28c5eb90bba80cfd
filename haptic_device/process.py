# SPDX-License-Identifier: Apache-2.0
"""What a process asks of the operating system about its own life, and how it says a line."""

import contextlib
import ctypes
import importlib
import os
import signal
import sys
from collections.abc import Callable, Iterator
from types import FrameType

Handler = Callable[[int, FrameType | None], object]
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # what tells a process to end
_PR_SET_PDEATHSIG = 1
_ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_libc = ctypes.CDLL(None, use_errno=True)


def die_with_parent(parent: int) -> None:
    """Ask Linux to send this process SIGTERM when the process `parent` (a pid) ends, however it ends.

    The request survives exec, unless the program holds file capabilities. SIGTERM and not SIGKILL, because a node that
    is asked still writes zero to the motor and removes its page. Raises OSError if the kernel refuses.
    """
    if _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG) was refused")
    if os.getppid() != parent:  # it ended before the request stood
        os._exit(1)


def ending_with_us(command: list[str]) -> list[str]:
    """The command line that runs `command` as a process which ends with this one, however this one ends.

    This file itself, run by a bare python, asks for it and then becomes the command, under the same pid: nothing of
    ours runs between fork and exec, where a process that has threads may not run Python.
    """
    return [sys.executable, "-I", "-S", __file__, str(os.getpid()), *map(str, command)]


def running_module(module: str) -> list[str]:
    """The beginning of a command line that runs a module of this very package, in `own_environment()`.

    Without -P Python would look into the current folder first, where a clone may lie beside an installed package.
    """
    return [sys.executable, "-P", "-m", module]


def own_environment() -> dict[str, str]:
    """This environment, in which Python finds this very package first."""
    others = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([_ROOT, *([others] if others else [])])}


@contextlib.contextmanager
def environment(settings: dict[str, str]) -> Iterator[None]:
    """This environment has these settings until the block is over."""
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            os.environ |= {} if value is None else {name: value}


def say(sentence: str) -> None:
    """Writes a line to standard error, if there is one, whole: where nothing is buffered `print` writes its end apart,
    and what another thread logs can come between."""
    if sys.stderr is not None:
        sys.stderr.write(f"{sentence}\n")
        sys.stderr.flush()


def hear(handler: Handler) -> None:
    """From now on SIGINT, SIGTERM and SIGHUP call handler(number, frame); so do those that `held` kept waiting."""
    for number in ENDING:
        signal.signal(number, handler)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)


@contextlib.contextmanager
def handling(handler: Handler) -> Iterator[None]:
    """As `hear`, until the block is over."""
    before = {number: signal.getsignal(number) for number in ENDING}
    hear(handler)
    try:
        yield
    finally:
        for number, one in before.items():
            signal.signal(number, one)


@contextlib.contextmanager
def held() -> Iterator[None]:
    """For this thread SIGINT, SIGTERM and SIGHUP wait until the block is over, and for a process that is started in it
    until it hears.

    Else they would end that process, or print a traceback, while its Python starts.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def start(module: str) -> int:
    """Imports a node's module, which takes seconds, and runs its main; returns the exit code.

    Told to end while it imports, the process ends at once with exit code 0: nothing has begun that is to be ended.
    """
    from haptic_device.ros_environment import check_room  # this file also runs where nothing else is found

    hear(lambda number, frame: os._exit(0))
    try:
        check_room()
    except (ValueError, OSError) as refusal:
        say(f"haptic_{module.rpartition('.')[2]}: {refusal}")
        return 1
    return importlib.import_module(module).main()


if __name__ == "__main__":
    die_with_parent(int(sys.argv[1]))
    os.execvp(sys.argv[2], sys.argv[2:])
