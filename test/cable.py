# SPDX-License-Identifier: Apache-2.0
"""A serial line that can be pulled out: `python cable.py LINK PORT` puts it at LINK, the device's PORT behind it.

Orders on standard input, each answered by an empty line: `close` takes the line away from the host, `open` gives it a
new one. A device that is gone takes the line away, until it is there.
"""

import contextlib
import os
import select
import sys
import tty

AGAIN = 0.02  # [s] between looks for a device that is gone


class Line:
    def __init__(self, where, port):
        self._where, self._port = where, port
        self.host = self.device = self._far = None
        self.closed = False

    def look(self):
        """Has both ends, or neither."""
        if self.device is None:
            with contextlib.suppress(OSError):
                self.device = os.open(self._port, os.O_RDWR | os.O_NOCTTY)
                tty.setraw(self.device)
        if self.device is not None and self.host is None and not self.closed:
            self.host, self._far = os.openpty()
            tty.setraw(self._far)
            os.set_blocking(self.host, False)
            os.symlink(os.ttyname(self._far), self._where)

    def close(self):
        """Takes the line away from the host."""
        if self.host is not None:
            os.unlink(self._where)
            os.close(self.host)
            os.close(self._far)
        self.host = None

    def carry(self, end):
        """Takes what has come at an end to the other one."""
        data = b""
        with contextlib.suppress(OSError):
            data = os.read(end, 4096)
        if not data:
            os.close(self.device)
            self.device = None
            self.close()
        elif self.host is not None:
            with contextlib.suppress(OSError):  # full, or gone
                os.write(self.device if end == self.host else self.host, data)


line = Line(*sys.argv[1:])
line.look()
print(flush=True)
while True:
    ends = [end for end in (line.host, line.device) if end is not None]
    ready = select.select([0, *ends], [], [], AGAIN)[0]
    for end in ready:
        if end != 0 and end in (line.host, line.device):
            line.carry(end)
    if 0 in ready:
        order = os.read(0, 4096)
        if not order:
            break
        line.closed = order == b"close\n"
        if line.closed:
            line.close()
    line.look()
    if 0 in ready:
        print(flush=True)
