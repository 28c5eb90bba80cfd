# SPDX-License-Identifier: Apache-2.0
"""One bag stored in fourteen ways and more: the same to the bit, or refused in a sentence, for all who read bags."""

import shutil
from dataclasses import fields

import numpy as np
import pytest
import stored_bags
from bag_of_a_run import swing, write_run
from stored_bags import REFUSED, WHOLE

from haptic_device.recording import load
from haptic_device.recording.metadata import METADATA
from haptic_display.run.report.reading import read_run

TICKS = 800


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("original") / "run", swing(TICKS))


@pytest.fixture
def bag(original, tmp_path):
    return shutil.copytree(original, tmp_path / "run")


def assert_same(one, other):
    """The same recording to the bit, whatever its bag and its notes are."""
    for name in {field.name for field in fields(one)} - {"bag", "notes", "joints", "clouds", "cloud_stamps", "pairs"}:
        assert getattr(one, name) == getattr(other, name), name
    assert one.clouds.keys() == other.clouds.keys() and one.joints.keys() == other.joints.keys()
    assert all(one.clouds[name].tobytes() == other.clouds[name].tobytes() for name in one.clouds)
    assert one.cloud_stamps.keys() == other.cloud_stamps.keys()
    assert all(np.array_equal(stamps, other.cloud_stamps[name]) for name, stamps in one.cloud_stamps.items())
    for name, joints in one.joints.items():
        assert joints.names == other.joints[name].names
        assert all(a.tobytes() == b.tobytes() for a, b in zip(joints[1:], other.joints[name][1:], strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(one.pairs, other.pairs, strict=True))


@pytest.mark.parametrize("way", WHOLE)
def test_a_bag_is_the_same_to_the_bit_however_it_is_stored(original, bag, way):
    store, notes = WHOLE[way]
    store(bag)
    assert_same(load(bag), load(original))
    assert load(bag).notes == tuple(read_run(bag).notes[: len(notes)]) == notes


@pytest.mark.parametrize("way", REFUSED)
def test_a_bag_that_is_not_read_is_refused_by_how_it_is_stored_and_left_as_it_is(bag, way):
    store, words = REFUSED[way]
    store(bag)
    stored = sorted(bag.iterdir())
    for named in (True, False):
        for read in (load, read_run):
            with pytest.raises(ValueError, match=words if named else "compressed|sqlite3") as refusal:
                read(bag)
            assert "\n" not in str(refusal.value) and sorted(bag.iterdir()) == stored
        if named:
            (bag / METADATA).unlink()
            stored = sorted(bag.iterdir())


def test_a_file_that_metadata_names_and_that_is_missing_is_said_and_the_others_are_read(original, bag):
    stored_bags.file_missing(bag)
    found, whole = load(bag), load(original)
    assert found.notes == ("run_1.mcap is missing, which metadata.yaml names",)
    assert 0 < len(found.trace) < TICKS
    assert np.all(np.isin(found.trace["tick"], whole.trace["tick"])) and np.all(np.diff(found.trace["tick"]) > 0)


def test_a_bag_none_of_whose_files_is_there_is_refused_with_the_names(bag):
    (bag / "run_0.mcap").rename(bag / "other.mcap")
    with pytest.raises(ValueError, match=r"none of the files .* metadata.yaml names \(run_0.mcap\); it has other"):
        load(bag)
    assert len(load(bag / "other.mcap").trace) == TICKS


def test_without_metadata_the_files_of_a_bag_bear_its_name(original, bag):
    """As its recorder left it when it was killed, and as somebody copied a file of it afterwards."""
    stored_bags.copy_beside(bag)
    (bag / METADATA).unlink()
    note = "copy.mcap is left out: without metadata.yaml, run_N.mcap are the bag's"
    assert_same(load(bag), load(original))
    assert load(bag).notes == (note,)


def test_a_clock_that_was_set_back_while_it_recorded_changes_no_order(bag):
    """The numbers of the one publisher say it; the times received would put later ticks between earlier ones."""
    messages, attachments = stored_bags.records_of(bag / "run_0.mcap")
    for _, channel, message in messages:
        if channel.topic == "/haptic/trace" and message.sequence > 5:
            message.log_time -= 300_000_000
    stored_bags.write(bag / "run_0.mcap", messages, attachments)
    assert np.array_equal(load(bag).trace["tick"], np.arange(TICKS))
