# SPDX-License-Identifier: Apache-2.0
"""A copy of this process that does what it is asked, and takes with it the memory that this took."""

import contextlib
import os
import signal
import threading
from multiprocessing import Pipe

WENT = EOFError, OSError  # what a pipe raises whose other end is closed


class Twin:
    """A fork that has imported what this process has, for requests that can be pickled; it calls begin() first.

    It ends when this process closes its end of the pipe, or on SIGTERM. To be made before there are other threads: what
    locks they hold would stay locked in the fork for ever.
    """

    def __init__(self, serve, begin):
        self._lock, (self._pipe, other) = threading.Lock(), Pipe()
        self._process = os.fork()
        if self._process == 0:
            _serve(serve, begin, other, self._pipe)
        other.close()

    def ask(self, request):
        """Has serve(request) done, and waits for it; that it failed or that the twin has gone makes no difference."""
        with self._lock, contextlib.suppress(*WENT):
            self._pipe.send(request)
            self._pipe.recv()

    def end(self):
        """Ends it; whoever asks from then on has no answer to wait for."""
        with self._lock:
            self._pipe.close()
            with contextlib.suppress(ChildProcessError):  # ended before
                os.waitpid(self._process, 0)


def _serve(serve, begin, pipe, others):
    """The twin's whole life. It holds no file of the other's open, and so none of its locks."""
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the other, with which it ends
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # at once: python would hear it after the request
        begin()
        others.close()  # its number may be below 3, where who started the other has closed those
        os.closerange(3, pipe.fileno())
        os.closerange(max(3, pipe.fileno() + 1), os.sysconf("SC_OPEN_MAX"))
        while True:
            request = pipe.recv()
            with contextlib.suppress(Exception):
                serve(request)
            pipe.send(None)
    finally:
        os._exit(0)
