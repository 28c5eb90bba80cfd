# SPDX-License-Identifier: Apache-2.0
"""What the page shows of recording: what the recorder does, the bags in its folder, and films of them."""

import asyncio
import itertools
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, NamedTuple

from haptic_device.recording.metadata import METADATA, said_in
from haptic_device.recording.status import Status
from haptic_display.page.films import Films

FOLDER = "haptic_bags"  # where a recorder without a name for its bag puts it
SAYING = "recording to "  # begins what a recorder that records says
MOST = 50  # bags that are listed, the newest
ABSENT, READY, STARTING, RECORDING, SAVING, SAVED = "no recorder", "ready", "starting", "recording", "saving", "saved"


class Bag(NamedTuple):
    """A recording in the folder: its length [s] as its metadata says, None if it was never closed; size [bytes]."""

    name: str
    path: Path
    seconds: float | None
    size: int


class Recordings:
    """`state` is one of the words above. changed(): is called when `news` has become other."""

    def __init__(self, changed: Callable[[], None] = lambda: None):
        self.state, self.problem = ABSENT, ""
        self.folder = Path(FOLDER).absolute()
        self.films = Films()
        self._changed, self._began, self._turned_ns = changed, 0.0, 0
        self._bag: Path | None = None
        self._bags: dict[str, Bag] = {}
        self._lengths: dict[tuple[Path, int], float | None] = {}  # by the metadata of this time [ns]
        self._told: dict[str, Any] = {}

    def news(self) -> dict[str, Any]:
        """For the page: state, seconds that it records, path of the present or last bag, all bags, the newest first."""
        bags = [{"name": bag.name, "seconds": bag.seconds, "size": bag.size} for bag in self._bags.values()]
        seconds = time.monotonic() - self._began if self.state == RECORDING else 0.0
        bag = str(self._bag or "")
        return {"state": self.state, "seconds": seconds, "bag": bag, "name": self._name(), "bags": bags}

    async def during(self, on: bool, asked: Awaitable[str]) -> str:
        """What the recorder answers to being switched on or off; the state says it meanwhile."""
        before = self.state
        self._turn(STARTING if on else SAVING)
        if on and before != RECORDING:
            self._bag = None
        try:
            sentence = await asked
        except (ValueError, OSError):
            self._turn(before)
            raise
        if on and before != RECORDING:
            self._began = time.monotonic()
        self._turned_ns = time.time_ns()
        self._turn(RECORDING if on else SAVED)
        await self.scan()
        return sentence

    def hear(self, said: Status | None) -> None:
        """What the recorder says of itself, None if it is not heard of: somebody else may switch it, too."""
        if self.state in (STARTING, SAVING):
            return
        if said is None:
            self._turn(ABSENT)
        elif said.message.startswith(SAYING):
            self._hear_of(Path(said.message.removeprefix(SAYING)), said.time)
        elif self.state == RECORDING and said.time > self._turned_ns:
            self._turn(SAVED)
        elif self.state == ABSENT:
            self._turn(READY)

    async def scan(self) -> None:
        """Looks at what lies in the folder, in a thread: an e-stop does not wait for a disk."""
        bags = await asyncio.to_thread(_bags_in, self.folder, self._lengths)
        recording = self._bag if self.state == RECORDING else None
        self._bags = {bag.name: bag for bag in bags if bag.path != recording}
        if self.state == SAVED and self._bag is None:  # it was shorter than the recorder's silence
            self._bag = next((bag.path for bag in self._bags.values()), None)
        self._tell()

    async def film(self, name: str) -> bytes:
        """The page that plays the bag of this name.

        Raises LookupError if there is no such bag, ValueError if its film could not be made: one sentence.
        """
        if name not in self._bags:
            raise LookupError(f"there is no recording {name!r} in {self.folder}")
        return await self.films.page(self._bags[name].path)

    def _hear_of(self, bag: Path, said_ns: int) -> None:
        if self.state != RECORDING and said_ns <= self._turned_ns:
            return  # said before it was switched off
        if self.state != RECORDING:
            self._began = time.monotonic()
        self._bag, self.folder = bag, _entry(bag).parent
        self._turn(RECORDING)

    def _name(self) -> str:
        """Of the present or last bag in the list; "" if it is not there."""
        return next((bag.name for bag in self._bags.values() if bag.path == self._bag), "")

    def _turn(self, state: str) -> None:
        self.state = state
        self._tell()

    def _tell(self) -> None:
        told = self.news() | {"seconds": 0.0}
        if told != self._told:
            self._told = told
            self._changed()


def _bags_in(folder: Path, lengths: dict[tuple[Path, int], float | None]) -> list[Bag]:
    """The newest bags, the newest first. One that cannot be read, or is deleted meanwhile, is left out."""
    try:
        entries = list(folder.iterdir())
    except OSError:
        return []
    found = sorted(filter(None, (_readable(_bag_of, entry) for entry in entries)), reverse=True)
    described = (_readable(_described, entry.name, bag, lengths) for _, entry, bag in found)
    return list(itertools.islice(filter(None, described), MOST))


def _readable(look: Callable[..., Any], *given: Any) -> Any:
    try:
        return look(*given)
    except OSError:
        return None


def _bag_of(entry: Path) -> tuple[float, Path, Path] | None:
    """The bag that an entry of the folder is, or has, as `haptic record` makes it: when it was changed [s], the entry,
    the bag. None if there is none."""
    if entry.is_symlink():
        return None
    bags = (bag for bag in (entry, entry / "bag") if bag.is_dir() and any(bag.glob("*.mcap")))
    return next(((bag.stat().st_mtime, entry, bag) for bag in bags), None)


def _entry(bag: Path) -> Path:
    return bag.parent if bag.name == "bag" else bag


def _described(name: str, bag: Path, lengths: dict[tuple[Path, int], float | None]) -> Bag:
    metadata = bag / METADATA
    key = bag, metadata.stat().st_mtime_ns if metadata.is_file() else 0
    if key not in lengths:
        duration = said_in(bag).get("duration")
        length = duration.get("nanoseconds") if isinstance(duration, dict) else None
        lengths[key] = length * 1e-9 if isinstance(length, int) else None
    return Bag(name, bag, lengths[key], sum(file.stat().st_size for file in bag.glob("*.mcap")))
