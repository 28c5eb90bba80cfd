# SPDX-License-Identifier: Apache-2.0
"""The bag as it is written: split, with attachments, and repaired after its writer died."""

import errno
import os
import shutil
import tracemalloc

import numpy as np
import pytest
from bag_of_a_run import (
    JOINTS,
    fill,
    information,
    joints,
    mcap_summary,
    numbered,
    swing,
    values_by_rosbags,
    write_run,
)
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.highlevel import AnyReader

from haptic_device.recording import load, recover
from haptic_device.recording.recover import recovered
from haptic_device.recording.writer import Bag


@pytest.fixture(scope="module")
def run_of(tmp_path_factory):
    """run_of(folder, ticks) puts a run of so many ticks there."""
    made = {}

    def copied(folder, ticks):
        if ticks not in made:
            made[ticks] = write_run(tmp_path_factory.mktemp("made") / "run", swing(ticks))
        return shutil.copytree(made[ticks], folder / "run")

    return copied


@pytest.mark.parametrize("limit", [{"split_seconds": 0.3}, {"split_bytes": 100_000}])
def test_a_split_bag_is_one_bag_to_every_reader_and_each_file_can_be_read_alone(tmp_path, limit):
    bag = Bag(tmp_path / "bag", **limit)
    bag.attach("trial.yaml", "application/yaml", b"participant: P7", 1)
    fill(bag, 1000)
    bag.close({})
    found = information(tmp_path / "bag")
    files = sorted((tmp_path / "bag").glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    assert len(files) >= 3 and found["relative_file_paths"] == [file.name for file in files]
    assert sum(file["message_count"] for file in found["files"]) == found["message_count"] == 1000
    assert values_by_rosbags(tmp_path / "bag") == list(range(1000))
    assert np.array_equal(load(tmp_path / "bag").joint("encoder").entry("n0"), np.arange(1000))
    for file, said in zip(files, found["files"], strict=True):
        alone = load(file)
        assert len(alone.joint("encoder").sequence) == said["message_count"]
        assert alone.attachments == {"trial.yaml": b"participant: P7"}


def test_a_bag_that_goes_on_in_a_new_file_keeps_no_memory_of_the_one_before(tmp_path):
    bag = Bag(tmp_path / "bag", split_seconds=4e-7)  # of these messages, one a nanosecond: 401 chunks
    channel, data = bag.add_topic("/haptic/topic", JOINTS, []), joints(["x"], np.zeros(1), 0)

    def memory_after(first, last):
        for number in range(first, last):
            bag.write(channel, data, number, number, number + 1)
            bag.flush()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        before = memory_after(0, 441)  # a second file, of 40 chunks
        assert memory_after(441, 842) - before < 4000  # bytes: a third file, of 40 chunks too
    finally:
        tracemalloc.stop()
    bag.close({})
    assert [len(mcap_summary(tmp_path / "bag" / f"bag_{i}.mcap").chunk_indexes) for i in (0, 1, 2)] == [401, 401, 40]


@few(8)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_of_a_file_cut_anywhere_all_whole_chunks_are_read_and_written_anew_and_it_stays_beside(
    tmp_path_factory, run_of, share
):
    folder = run_of(tmp_path_factory.mktemp("cut"), 1200)
    (folder / "metadata.yaml").unlink()
    file, before = folder / "run_0.mcap", {}
    data = file.read_bytes()
    file.write_bytes(cut := data[: max(60, int(share * len(data)))])
    try:
        found = load(file)
    except ValueError as error:
        assert str(file) in str(error) and "\n" not in str(error)
    else:
        before = {f"/haptic/{name}": len(joints.sequence) for name, joints in found.joints.items()}
    said = list(recovered(folder))
    assert "metadata.yaml is written" in said[-1] and (folder / "run_0.mcap.damaged").read_bytes() == cut
    if before:
        with AnyReader([folder]) as reader:
            counts = {connection.topic: connection.msgcount for connection in reader.connections}
        assert {name: counts[name] for name in before} == before
        assert load(folder).notes == ()
    assert mcap_summary(file) and list(recovered(folder))[0].startswith("run_0.mcap: whole")


def test_a_writer_killed_leaves_all_that_was_flushed_readable_and_nothing_half(tmp_path):
    """What stands in the file, while what the writer has not flushed is its own."""
    bag = Bag(tmp_path / "writing")
    fill(bag, 340)  # flushed after each 50
    shutil.copytree(tmp_path / "writing", tmp_path / "killed")
    bag.close({})
    recording = load(tmp_path / "killed")
    assert recording.joint("encoder").entry("n0").tolist() == list(range(300))
    assert "ends without its index" in recording.notes[0] and not (tmp_path / "killed" / "metadata.yaml").exists()


@few(15)
@given(place=st.floats(0.0, 1.0, exclude_max=True), value=st.integers(1, 255))
def test_a_flipped_byte_costs_at_most_its_own_record_and_never_a_traceback(tmp_path_factory, run_of, place, value):
    folder = run_of(tmp_path_factory.mktemp("flip"), 800)
    file = folder / "run_0.mcap"
    data = bytearray(file.read_bytes())
    data[int(place * len(data))] ^= value
    file.write_bytes(data)
    for read in (load, lambda bag: list(recovered(bag)), load):  # as it is, and after the repair
        try:
            recording = read(folder)
        except ValueError as error:
            assert "\n" not in str(error)
        else:
            if "trace" in getattr(recording, "clouds", ()):
                assert set(recording.trace["tick"]) <= set(range(800))


def damage(file, number):
    """A byte in the middle of this chunk is another; messages that the chunk held."""
    place = mcap_summary(file).chunk_indexes[number]
    with open(file, "rb") as stream:
        chunks = [one for one in StreamReader(stream, emit_chunks=True).records if isinstance(one, Chunk)]
    data = bytearray(file.read_bytes())
    data[place.chunk_start_offset + place.chunk_length // 2] ^= 0xFF
    file.write_bytes(data)
    return sum(isinstance(record, Message) for record in breakup_chunk(chunks[number]))


@pytest.mark.parametrize("damaged", [0, -1])
def test_a_damaged_chunk_is_passed_over_by_every_reader_and_after_the_repair_no_other_misses_topic_or_index(
    tmp_path, run_of, damaged
):
    folder = run_of(tmp_path, 4000)
    file = folder / "run_0.mcap"
    lost = damage(file, damaged)
    before = information(folder)["message_count"]
    assert sum(load(folder).counts.values()) == before - lost and "is damaged" in load(folder).notes[0]
    assert "1 damaged records are passed over" in list(recovered(folder))[0]
    assert sum(load(folder).counts.values()) == information(folder)["message_count"] == before - lost
    assert load(folder).notes == () and mcap_summary(file).statistics.message_count == before - lost
    with open(file, "rb") as stream:
        assert sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages()) == before - lost


def test_of_attachments_the_newest_state_counts_and_a_damaged_one_is_passed_over(tmp_path):
    bag, file = Bag(tmp_path / "bag"), tmp_path / "bag/bag_0.mcap"
    for name, state in (("made.yaml", b"old"), ("trial.yaml", b"old"), ("trial.yaml", b"new")):
        bag.attach(name, "application/yaml", state, 5)
    fill(bag, 100)
    bag.close({})
    assert load(tmp_path / "bag").attachments == {"made.yaml": b"old", "trial.yaml": b"new"}
    data = bytearray(file.read_bytes())
    data[data.index(b"made.yaml") - 1] = 0xFF  # of the length of its name
    file.write_bytes(data)
    assert "damaged in 1 places" in load(tmp_path / "bag").notes[0]
    said = list(recovered(tmp_path / "bag"))[0]
    assert "1 damaged records are passed over" in said and "; 100 messages" in said
    found = load(tmp_path / "bag")
    assert found.attachments == {"trial.yaml": b"new"} and found.notes == ()


@pytest.fixture
def cut(tmp_path, run_of):
    """A bag whose one file ends without its index."""
    folder = run_of(tmp_path, 400)
    file = folder / "run_0.mcap"
    file.write_bytes(file.read_bytes()[:-100])
    return folder


def test_a_repair_keeps_the_file_that_an_earlier_one_kept_and_replaces_what_it_had_half_written(cut, monkeypatch):
    def refuse(*given):  # as on a stick
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(recover.os, "link", refuse)
    file, before = cut / "run_0.mcap", (cut / "run_0.mcap").read_bytes()
    (cut / "run_0.mcap.damaged").write_text("earlier")
    (cut / "run_0.mcap.part").write_text("half")
    assert "as it was: run_0.mcap.damaged1" in list(recovered(cut))[0]
    assert (cut / "run_0.mcap.damaged").read_text() == "earlier"
    assert (cut / "run_0.mcap.damaged1").read_bytes() == before and mcap_summary(file)
    assert not (cut / "run_0.mcap.part").exists()


def test_a_repair_that_is_killed_at_any_step_leaves_a_file_of_that_name(cut, monkeypatch):
    there = []
    for real in (os.link, os.rename, os.replace):

        def step(*given, real=real):
            real(*given)
            there.append((cut / "run_0.mcap").exists())

        monkeypatch.setattr(os, real.__name__, step)
    assert list(recovered(cut)) and len(there) >= 2 and all(there)


@pytest.mark.parametrize("trouble", [OSError(errno.EROFS, os.strerror(errno.EROFS)), KeyboardInterrupt()])
def test_a_repair_that_cannot_write_or_is_interrupted_leaves_the_folder_as_it_was(cut, monkeypatch, trouble):
    def stop(*given):
        raise trouble

    before = {path: path.read_bytes() for path in cut.iterdir()}
    monkeypatch.setattr(recover, "_copy", stop)
    with pytest.raises(type(trouble)):
        list(recovered(cut))
    assert {path: path.read_bytes() for path in cut.iterdir()} == before


NUMBERS = {  # of each topic's publishers, how many messages are lost then, and what recovery writes of it
    "/haptic/encoder": ((1, 2, 3, 7, 8, 10), 4, "4"),
    "/haptic/handle": ((7, 8, 1, 3), 1, "1"),  # a publisher that started anew
    "/haptic/wrench": ((1, 50, 2, 51, 3), None, "unknown, several publishers"),
    "/diagnostics": ((1, 9), None, "unknown, several publishers"),
}


@pytest.mark.parametrize("limit", [{}, {"split_seconds": 2.0}])
def test_recovery_counts_the_publishers_numbers_that_were_skipped_between_two_files_too_and_invents_no_loss(
    tmp_path, limit
):
    numbered(tmp_path / "bag", {topic: numbers for topic, (numbers, *_) in NUMBERS.items()}, **limit)
    assert (len(list((tmp_path / "bag").glob("*.mcap"))) >= 2) == bool(limit)
    lost = {topic: count for topic, (_, count, _) in NUMBERS.items()}
    assert load(tmp_path / "bag").lost == lost and list(recovered(tmp_path / "bag"))
    said = {f"lost {topic}": text for topic, (*_, text) in NUMBERS.items()}
    assert information(tmp_path / "bag")["custom_data"] == {"recovered": "true"} | said
    assert load(tmp_path / "bag").lost == lost


def test_recovery_keeps_what_the_recorder_said_and_adds_what_the_files_lack(tmp_path):
    said = {"namespace": "/haptic", "participant": "P7", "lost /haptic/encoder": "1"}
    numbered(tmp_path / "bag", {"/haptic/encoder": (1, 2, 4, 5, 6)}).close(said)
    damage(tmp_path / "bag" / "bag_0.mcap", 3)
    assert list(recovered(tmp_path / "bag"))
    found = information(tmp_path / "bag")["custom_data"]
    assert found == said | {"missing /haptic/encoder": "2", "recovered": "true"}


def test_what_cannot_be_repaired_is_refused_and_a_stranger_in_the_folder_left_alone(tmp_path, run_of):
    (tmp_path / "notes.mcap").write_text("not a bag at all")
    with pytest.raises(ValueError, match="no file that could be repaired"):
        list(recovered(tmp_path))
    with pytest.raises(FileNotFoundError, match="does not exist"):
        list(recovered(tmp_path / "missing"))
    run_of(tmp_path, 400)
    (tmp_path / "notes.mcap").rename(tmp_path / "run" / "notes.mcap")
    assert "notes.mcap is left out" in list(recovered(tmp_path / "run"))[0]
    assert (tmp_path / "run" / "notes.mcap").read_text() == "not a bag at all"
    assert len(load(tmp_path / "run").trace) == 400
