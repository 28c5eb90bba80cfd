# SPDX-License-Identifier: Apache-2.0
"""Bags on a disk that fills, and of a writer that is killed; what it flushed is read in test/unit/test_recording.py."""

import errno
import os
import resource
from pathlib import Path

import pytest
from bag_of_a_run import fill, information, numbered, values_by_rosbags
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.recording import load, writer
from haptic_device.recording.writer import Bag


@few(50)
@given(limit=st.integers(50_000, 200_000))
def test_a_disk_that_is_full_is_said_and_every_whole_chunk_is_read(tmp_path_factory, limit):
    folder = tmp_path_factory.mktemp("limit") / "bag"
    bag = Bag(folder)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        for end in (lambda: fill(bag, 2000), lambda: bag.close({"namespace": "/haptic"})):
            with pytest.raises(OSError, match="File too large"):
                end()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.name for path in folder.iterdir()] == ["bag_0.mcap"]
    found = load(folder)
    kept = found.joint("encoder").entry("n0").tolist()
    assert 50 <= len(kept) <= bag.messages and kept == list(range(len(kept)))
    assert "ends without its index" in found.notes[0] and (folder / "bag_0.mcap").stat().st_size == limit


def test_metadata_that_finds_no_room_leaves_no_half_of_it(tmp_path, monkeypatch):
    bag = numbered(tmp_path / "bag", {"/haptic/encoder": (1, 2)})

    def refuse(path, *given, **named):
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as full:
        full.setattr(Path, "write_text", refuse)
        with pytest.raises(OSError, match="No space left on device.*metadata.yaml"):
            bag.close({})
    assert [path.name for path in bag.folder.iterdir()] == ["bag_0.mcap"]


def as_a_file_is_ended(begin, monkeypatch):
    """From the end of a file on, the disk does what `begin` makes it do."""
    finish = writer.Writer.finish

    def ending(self):
        begin()
        finish(self)

    monkeypatch.setattr(writer.Writer, "finish", ending)


def test_a_split_that_can_open_no_file_ends_the_bag_whole(tmp_path, monkeypatch):
    bag = Bag(tmp_path / "bag", split_seconds=0.3)

    def refuse(*given):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with monkeypatch.context() as failing:
        failing.setattr(writer.os, "open", refuse)
        with pytest.raises(OSError, match="Too many open files"):
            fill(bag, 1000)
        bag.close({})
    assert bag.messages == 350 and information(bag.folder)["message_count"] == 350
    assert sorted(path.name for path in bag.folder.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    assert values_by_rosbags(bag.folder) == list(range(350))


def tears(monkeypatch):
    """The disk takes half of the next write, fails once and then has room."""
    real, failures = os.write, iter([None, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))])

    def write(descriptor, data):
        try:
            failure = next(failures)
        except StopIteration:
            return real(descriptor, data)
        if failure:
            raise failure
        return real(descriptor, data[: len(data) // 2])

    monkeypatch.setattr(writer.os, "write", write)


@pytest.mark.parametrize(("split", "kept"), [(0.0, 100), (0.3, 350)])
def test_nothing_follows_a_torn_record_and_the_end_says_what_the_disk_said(tmp_path, monkeypatch, split, kept):
    bag = Bag(tmp_path / "bag", split_seconds=split)
    fill(bag, 100)
    with monkeypatch.context() as failing:
        if split:
            as_a_file_is_ended(lambda: tears(failing), failing)
        else:
            tears(failing)
        for end in (lambda: fill(bag, 1000, first=100), lambda: bag.close({})):
            with pytest.raises(OSError, match="No space left"):
                end()
    assert not (bag.folder / "metadata.yaml").exists()
    assert load(bag.folder).joint("encoder").entry("n0").tolist() == list(range(kept))
