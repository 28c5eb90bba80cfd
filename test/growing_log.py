# SPDX-License-Identifier: Apache-2.0
"""A log that a device writes while a test looks at it. Each line is read once: a look costs the machine little."""

from collections import defaultdict


class GrowingLog:
    """The whole lines so far, as lists of words, apart by what `kind` gives for their words."""

    def __init__(self, path, kind):
        self._path, self._kind, self._read, self._lines = path, kind, 0, defaultdict(list)

    def lines(self, kind):
        """Those of this kind, the oldest first; the list grows with the next look."""
        with open(self._path, "rb") as file:
            file.seek(self._read)
            whole, end, _ = file.read().rpartition(b"\n")
        self._read += len(whole + end)
        for words in map(str.split, whole.decode().splitlines()):
            self._lines[self._kind(words)].append(words)
        return self._lines[kind]
