# SPDX-License-Identifier: Apache-2.0
"""What a process asks of the operating system about its own life."""

import ctypes
import os
import signal

_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


def die_with_parent(parent: int) -> None:
    """Ask Linux to send this process SIGTERM when the process `parent` (a pid) ends, however it ends.

    Called between fork and exec; the request survives exec, unless the program holds file capabilities. SIGTERM and
    not SIGKILL, because a node that is asked still writes zero to the motor and removes its page.
    Raises OSError if the kernel refuses.
    """
    if _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_PDEATHSIG) was refused")
    if os.getppid() != parent:  # it ended before the request stood
        os._exit(1)
