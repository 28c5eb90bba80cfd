# SPDX-License-Identifier: Apache-2.0
"""Bags on a disk that fills, and of a writer that is killed; what it flushed is read in test/unit/test_recording.py."""

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from bag_of_a_run import fill, information, mcap_summary, numbered, values_by_rosbags
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.recording import writer
from haptic_device.recording.recover import recovered
from haptic_device.recording.writer import RESERVE_BYTES, Bag, Reserve


def fills_at(capacity, monkeypatch):
    """From now on the disk takes so many bytes of files of a bag, and the reserve's more once that is given back."""
    real, written, given = os.write, 0, []
    give_back = Reserve.give_back

    def give(reserve):
        given[:] = [RESERVE_BYTES]
        give_back(reserve)

    monkeypatch.setattr(Reserve, "give_back", give)

    def write(descriptor, data):
        nonlocal written
        room = capacity + sum(given) - written
        if room <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        count = real(descriptor, data[:room])
        written += count
        return count

    monkeypatch.setattr(writer.os, "write", write)


@few(50)
@given(capacity=st.integers(2_000, 200_000))
def test_a_full_disk_keeps_every_message_in_a_bag_that_opens(tmp_path_factory, capacity):
    folder = tmp_path_factory.mktemp("disk") / "bag"
    bag = Bag(folder)
    with pytest.MonkeyPatch.context() as monkeypatch:
        fills_at(capacity, monkeypatch)
        with pytest.raises(OSError, match="No space left on device.*bag_0.mcap"):
            fill(bag, 2000)
        bag.close({"namespace": "/haptic"})
    kept = bag.messages
    assert kept >= 50 and information(folder)["message_count"] == kept
    assert sorted(path.name for path in folder.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    assert values_by_rosbags(folder) == list(range(kept))
    assert mcap_summary(folder / "bag_0.mcap").statistics.message_count == kept


@few(50)
@given(limit=st.integers(50_000, 200_000))
def test_a_file_that_may_not_grow_is_said_and_recovery_keeps_every_whole_chunk(tmp_path_factory, limit):
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
    assert list(recovered(folder))
    kept = information(folder)["message_count"]
    assert 50 <= kept <= bag.messages and values_by_rosbags(folder) == list(range(kept))
    assert 2 * (folder / "bag_0.mcap").stat().st_size > limit


@pytest.mark.parametrize("limit", [0, 1000, RESERVE_BYTES // 2])
def test_a_bag_that_finds_no_room_for_its_reserve_names_the_folder_and_leaves_nothing(tmp_path, limit):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        with pytest.raises(OSError, match="File too large") as refused:
            Bag(tmp_path / "bag")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert refused.value.filename == str(tmp_path / "bag") and not any((tmp_path / "bag").iterdir())
    Bag(tmp_path / "bag").close({})  # once there is room


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


@pytest.mark.parametrize("trouble", ["No space left", "Too many open files"])
def test_a_split_that_meets_a_full_disk_or_can_open_no_file_ends_the_bag_whole(tmp_path, monkeypatch, trouble):
    bag = Bag(tmp_path / "bag", split_seconds=0.3)

    def refuse(*given):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with monkeypatch.context() as failing:
        if trouble == "No space left":
            as_a_file_is_ended(lambda: fills_at(0, failing), failing)
        else:
            failing.setattr(writer.os, "open", refuse)
        with pytest.raises(OSError, match=trouble):
            fill(bag, 1000)
        bag.close({})
    assert bag.messages == 350 and information(bag.folder)["message_count"] == 350
    assert sorted(path.name for path in bag.folder.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    assert values_by_rosbags(bag.folder) == list(range(350))


def tears(monkeypatch):
    """The disk takes half of the next write, fails twice and then has room."""
    real, failures = os.write, iter([None, *2 * [OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))]])

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
    assert list(recovered(bag.folder)) and values_by_rosbags(bag.folder) == list(range(kept))


def test_a_writer_that_is_killed_leaves_no_reserve_behind(tmp_path, start):
    code = "import sys, pathlib; from haptic_device.recording.writer import Bag; bag = Bag(pathlib.Path(sys.argv[1]))"
    ending = "; print('begun', flush=True); sys.stdin.read()"
    writer = start(
        [sys.executable, "-c", code + ending, str(tmp_path / "bag")], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert writer.stdout.readline() == "begun\n"
    writer.kill()
    writer.wait()
    assert [path.name for path in (tmp_path / "bag").iterdir()] == ["bag_0.mcap"]
