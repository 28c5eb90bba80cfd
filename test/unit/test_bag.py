# SPDX-License-Identifier: Apache-2.0
"""The bag as it is written: split, with attachments; and as it is read after its writer died, or damaged."""

import shutil
import tracemalloc

import numpy as np
import pytest
from bag_of_a_run import JOINTS, fill, information, joints, mcap_summary, numbered, swing, values_by_rosbags, write_run
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from haptic_device.recording import load
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


def chunks(file):
    """(byte after it, its messages) of each chunk of a whole file."""
    places = mcap_summary(file).chunk_indexes
    with open(file, "rb") as stream:
        found = [one for one in StreamReader(stream, emit_chunks=True).records if isinstance(one, Chunk)]
    messages = [sum(isinstance(record, Message) for record in breakup_chunk(one)) for one in found]
    return [(one.chunk_start_offset + one.chunk_length, held) for one, held in zip(places, messages, strict=True)]


@few(8)
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_of_a_file_cut_anywhere_all_whole_chunks_are_read_and_the_cut_is_said(tmp_path_factory, run_of, share):
    folder = run_of(tmp_path_factory.mktemp("cut"), 1200)
    (folder / "metadata.yaml").unlink()
    file = folder / "run_0.mcap"
    data, whole = file.read_bytes(), chunks(file)
    left = max(60, int(share * len(data)))
    file.write_bytes(data[:left])
    kept = sum(held for end, held in whole if end <= left)
    if kept:
        found = load(folder)
        assert sum(found.counts.values()) == kept and "ends without its index" in found.notes[0]
    else:
        with pytest.raises(ValueError, match=r"holds no message; run_0\.mcap ends without its index"):
            load(folder)
    assert file.read_bytes() == data[:left]


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
    try:
        recording = load(folder)
    except ValueError as error:
        assert "\n" not in str(error)
    else:
        if "trace" in recording.clouds:
            assert set(recording.trace["tick"]) <= set(range(800))


def damage(file, number):
    """A byte in the middle of this chunk is another; messages that the chunk held."""
    place, held = mcap_summary(file).chunk_indexes[number], chunks(file)[number][1]
    data = bytearray(file.read_bytes())
    data[place.chunk_start_offset + place.chunk_length // 2] ^= 0xFF
    file.write_bytes(data)
    return held


@pytest.mark.parametrize("damaged", [0, -1])
def test_a_damaged_chunk_costs_no_other_its_topic_and_is_said(tmp_path, run_of, damaged):
    folder = run_of(tmp_path, 4000)
    file = folder / "run_0.mcap"
    lost = damage(file, damaged)
    before = information(folder)["message_count"]
    assert sum(load(folder).counts.values()) == before - lost and "is damaged" in load(folder).notes[0]


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
    assert load(tmp_path / "bag").attachments == {"trial.yaml": b"new"}
    assert load(tmp_path / "bag").counts == {"/haptic/encoder": 100}


NUMBERS = {  # of each topic's publishers, and how many messages are lost then
    "/haptic/encoder": ((1, 2, 3, 7, 8, 10), 4),
    "/haptic/handle": ((7, 8, 1, 3), 1),  # a publisher that started anew
    "/haptic/wrench": ((1, 50, 2, 51, 3), None),
    "/diagnostics": ((1, 9), None),
}


@pytest.mark.parametrize("limit", [{}, {"split_seconds": 2.0}])
def test_numbers_that_were_skipped_between_two_files_count_too_and_no_loss_is_invented(tmp_path, limit):
    numbered(tmp_path / "bag", {topic: numbers for topic, (numbers, _) in NUMBERS.items()}, **limit)
    assert (len(list((tmp_path / "bag").glob("*.mcap"))) >= 2) == bool(limit)
    assert load(tmp_path / "bag").lost == {topic: count for topic, (_, count) in NUMBERS.items()}


def test_what_is_no_bag_is_refused_and_a_stranger_in_the_folder_left_out(tmp_path, run_of):
    (tmp_path / "notes.mcap").write_text("not a bag at all")
    with pytest.raises(ValueError, match="holds no message; .*it is no MCAP file"):
        load(tmp_path)
    with pytest.raises(FileNotFoundError, match="does not exist"):
        load(tmp_path / "missing")
    run_of(tmp_path, 400)
    (tmp_path / "notes.mcap").rename(tmp_path / "run" / "notes.mcap")
    assert "notes.mcap is left out" in load(tmp_path / "run").notes[0]
    assert len(load(tmp_path / "run").trace) == 400
