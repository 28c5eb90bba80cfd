# SPDX-License-Identifier: Apache-2.0
"""Which files a bag has, in the order of their messages, and what is not read: other storages, and strangers beside."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Message, Statistics

from haptic_device.recording.mcap_records import Records
from haptic_device.recording.metadata import METADATA, said_in

OF_RUN = "bag"  # name of the bag in the folder of a run
_CONVERT = "`ros2 bag convert` makes an uncompressed MCAP bag of it"
_ENDINGS = {
    ".db3": "stored as sqlite3",
    ".zstd": "compressed (compression_mode: file)",
}  # of files that are none of ours


class BagFiles(NamedTuple):
    """Paths of a bag's files in the order of their messages; a sentence for each that is missing or left out."""

    paths: list[Path]
    notes: list[str]


def files_of(bag: Path) -> BagFiles:
    """The MCAP files of a bag folder, or the one file given.

    They are those that metadata.yaml names; without it, those named as rosbag2 does (FOLDER_0.mcap), or all if none
    is. Raises FileNotFoundError, or ValueError with a sentence for a folder of which nothing can be read.
    """
    if bag.is_file():
        return BagFiles([bag], [])
    if not bag.is_dir():
        raise FileNotFoundError(f"bag {bag} does not exist")
    said, there = said_in(bag), {path.name: path for path in sorted(bag.glob("*.mcap"))}
    if stored := _storage(bag, said, there):
        raise ValueError(f"bag {bag} is {stored}, which is not read here: {_CONVERT}")
    if not there:
        within = f"; did you mean {bag / OF_RUN}?" if any((bag / OF_RUN).glob("*.mcap")) else ""
        raise ValueError(f"folder {bag} holds no .mcap file, so it is no bag of this kind{within}")
    named = [Path(str(name)).name for name in said.get("relative_file_paths") or ()]
    chosen = named or [name for name in there if _is_numbered(bag, name)] or list(there)
    found = [there[name] for name in dict.fromkeys(chosen) if name in there]
    if not found:
        told = ", ".join(named), ", ".join(there)
        raise ValueError(f"bag {bag} has none of the files that its {METADATA} names ({told[0]}); it has {told[1]}")
    return BagFiles(_in_time(found), list(_notes(bag, said, chosen, there)))


def _storage(bag: Path, said: dict[str, Any], there: dict[str, Path]) -> str:
    """How the bag is stored, if it is no plain MCAP, by its metadata or else by its files."""
    kind, mode = (str(said.get(name) or "") for name in ("storage_identifier", "compression_mode"))
    if kind not in ("", "mcap"):
        return f"stored as {kind} (storage_identifier)"
    if mode.lower() not in ("", "none"):
        return f"compressed (compression_mode: {mode.lower()})"
    endings = () if there else sorted({path.suffix for path in bag.iterdir()} & set(_ENDINGS))
    return next((_ENDINGS[ending] for ending in endings), "")


def _is_numbered(bag: Path, name: str) -> bool:
    return re.fullmatch(rf"{re.escape(bag.resolve().name)}_\d+\.mcap", name) is not None


def _notes(bag: Path, said: dict[str, Any], chosen: list[str], there: dict[str, Path]) -> Iterator[str]:
    for name in chosen:
        if name not in there:
            yield f"{name} is missing, which {METADATA} names"
    why = f"{METADATA} does not name it" if said else f"without {METADATA}, {bag.resolve().name}_N.mcap are the bag's"
    for name in there:
        if name not in chosen:
            yield f"{name} is left out: {why}"


def _in_time(paths: list[Path]) -> list[Path]:
    """In the order of their first messages; those without any at the end."""
    return sorted(paths, key=lambda path: (_begin(path), len(path.name), path.name)) if len(paths) > 1 else paths


def _begin(path: Path) -> float:
    """When the first message of a file came [ns]: by its summary, or else that of its first message."""
    try:
        with open(path, "rb") as stream:
            for record in Records(stream):
                if isinstance(record, Statistics) and record.message_count:
                    return record.message_start_time
                if isinstance(record, Message):
                    return record.log_time
    except ValueError:
        pass
    return math.inf
