# SPDX-License-Identifier: Apache-2.0
"""What a process asks of the operating system about its own life."""

import ctypes
import os
import signal
import sys

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


if __name__ == "__main__":
    die_with_parent(int(sys.argv[1]))
    os.execvp(sys.argv[2], sys.argv[2:])
