# SPDX-License-Identifier: Apache-2.0
"""A log that a device writes while a test looks at it. Each line is read once: a look costs the machine little."""

from collections import defaultdict


class GrowingLog:
    """The whole lines so far, by kind; kind_of(words) tells a line's."""

    def __init__(self, path, kind_of):
        self._path, self._kind_of, self._at, self._lines = path, kind_of, 0, defaultdict(list)

    def lines(self, kind):
        """Those of this kind, the oldest first; the list grows with the next look."""
        with open(self._path, "rb") as file:
            file.seek(self._at)
            whole, end, _ = file.read().rpartition(b"\n")
        self._at += len(whole + end)
        for line in whole.decode().splitlines():
            self._lines[self._kind_of(line.split())].append(line)
        return self._lines[kind]
