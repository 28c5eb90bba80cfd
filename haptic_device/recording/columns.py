# SPDX-License-Identifier: Apache-2.0
"""Collectors that turn serialized messages into arrays: JointStates by entry, clouds of records by column."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from haptic_device.recording.layouts import CLOUD, PARTS, STAMPED, layout_of


class Entries(NamedTuple):
    """What to read from a JointState topic. The rest stays empty.

    Attributes:
        names: entries of the topic, by name.
        parts: which of position, velocity and effort.

    Examples:
        >>> from haptic_device.recording import Entries, load
        >>> only = {"operator/state": Entries(("x", "energy_given"), ("position",))}
        >>> load("run/bag", only=only).joint("operator/state").position.shape  # (messages, entries)
        (1000, 2)
    """

    names: tuple[str, ...]
    parts: tuple[str, ...] = PARTS


class JointColumns:
    """Position, velocity, effort of a JointState topic or one of STAMPED; of the entries wanted, or of all.

    kept: for each message whether it had the layout of the first; the others are left out.
    """

    def __init__(self, type_name: str, entries: Entries | None = None) -> None:
        self._type_name, self._wanted = type_name, entries
        self._layout: Any = None  # of the first message
        self._parts: list[npt.NDArray[Any]] = []
        self._count = 0
        self.kept: list[bool] = []

    def add(self, data: list[bytes]) -> None:
        """Takes the next messages. Raises ValueError if the first of all has no such layout."""
        if self._layout is None:
            self._begin(data[0])
        kept = [self._layout.matches(item) for item in data]
        self.kept += kept
        _, *pieces = self._layout.arrays([item for item, keep in zip(data, kept, strict=True) if keep])
        before, self._count = self._count, self._count + sum(kept)
        for part, piece, index in zip(self._parts, pieces, self._index, strict=True):
            _make_room(part, self._count)
            part[before : self._count] = piece[:, index]

    def reorder(self, order: npt.NDArray[np.intp]) -> None:
        """Puts all messages into this order."""
        kept = np.array(self.kept, bool)
        rows = (np.cumsum(kept) - 1)[order][kept[order]]
        self._parts, self.kept = [part[rows] for part in self._parts], kept[order].tolist()

    def arrays(self) -> list[npt.NDArray[Any]]:
        """Position, velocity, effort as (messages, names)."""
        for part in self._parts:
            part.resize((self._count, *part.shape[1:]), refcheck=False)
        return self._parts

    def _begin(self, first: bytes) -> None:
        self._layout = layout_of(self._type_name, first)
        everything = self._layout.names
        wanted = self._wanted or Entries(everything, STAMPED.get(self._type_name, ("", PARTS))[1])
        self.names = tuple(name for name in everything if name in wanted.names)
        index = [everything.index(name) for name in self.names]
        self._index = [index if part in wanted.parts else [] for part in PARTS]
        self._parts = [np.empty((0, len(columns))) for columns in self._index]


RENAMED = {"warmth": "thermal_load", "exchange_let_go": "exchange_released"}
"""Columns of the trace that bags of before have by another name."""


class CloudColumns:
    """Records of a PointCloud2 topic: with the columns and types of a structured type, or all as they are.

    begins: of each message taken the index of its first record. A column that the messages lack is NaN and stands in
    `missing`. kept: as of JointColumns.
    """

    def __init__(self, columns: np.dtype[np.void] | None = None) -> None:
        self._wanted = columns
        self._rows: npt.NDArray[Any] = np.empty(0)
        self._layout: Any = None  # of the first message
        self._record: Any = None
        self.begins: list[int] = []
        self._count = 0
        self.kept: list[bool] = []
        self.missing: list[str] = []

    def add(self, data: list[bytes]) -> None:
        """Takes the next messages. Raises ValueError if the first of all is no cloud of named fields."""
        if self._layout is None:
            self._layout = layout_of(CLOUD, data[0])
            self._record = self._layout.record.newbyteorder("=")  # a copy, whose names may change
            self._record.names = tuple(RENAMED.get(name, name) for name in self._record.names)
            self._rows = np.empty(0, self._record if self._wanted is None else self._subset(self._wanted))
        pieces, before = [], self._count
        for message in data:
            self.kept.append(self._layout.matches(message))
            if not self.kept[-1]:
                continue
            pieces.append(self._layout.records(message))
            self.begins.append(self._count)
            self._count += len(pieces[-1]) // self._record.itemsize
        _make_room(self._rows, self._count)
        self._fill(self._rows[before : self._count], np.frombuffer(b"".join(pieces), self._record))

    def reorder(self, order: npt.NDArray[np.intp]) -> None:
        """Puts all messages into this order."""
        kept = np.array(self.kept, bool)
        blocks = (np.cumsum(kept) - 1)[order][kept[order]]
        begins = np.array([*self.begins, self._count])
        rows = [np.arange(begins[block], begins[block + 1]) for block in blocks]
        self._rows = self._rows[np.concatenate([np.empty(0, np.intp), *rows])]
        self.begins = np.cumsum([0, *map(len, rows)])[:-1].tolist()
        self.kept = kept[order].tolist()

    def records(self) -> npt.NDArray[np.void]:
        """All records as one structured array."""
        self._rows.resize(self._count, refcheck=False)
        return self._rows

    def of_rows(self, stamps: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """For each record the stamp [ns] of its message; stamps: of all messages."""
        return np.repeat(stamps[self.kept], np.diff([*self.begins, self._count]))

    def _subset(self, wanted: np.dtype[np.void]) -> np.dtype[np.void]:
        there = self._record
        self.missing = [n for n in wanted.names or () if n not in there.names or there[n].shape != wanted[n].shape]
        return wanted

    def _fill(self, target: npt.NDArray[Any], rows: npt.NDArray[Any]) -> None:
        if self._wanted is None:
            target[:] = rows
            return
        for name in target.dtype.names or ():
            target[name] = np.nan if name in self.missing else rows[name]


def _make_room(rows: npt.NDArray[Any], count: int) -> None:
    """Grows in place, where the operating system can: the whole is never there twice."""
    if count > len(rows):
        rows.resize((count + count // 8, *rows.shape[1:]), refcheck=False)
