# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder alive, between a publisher in this process and a bag on the disk."""

import contextlib
import os
import subprocess
import time

import numpy as np
import pytest
import yaml
from live_nodes import command, refusal_of
from rosbags.highlevel import AnyReader
from speaker import STIFFNESS, Speaker, custom_data, joint, numbers
from waiting import LIMIT, until

from haptic_device.recording import load
from haptic_display.cli import mark


@pytest.fixture(scope="module")
def recorded(ros_domain, nodes, tmp_path_factory):
    """(bag, time before and after its first mark [ns]) of a recorder that has ended well."""
    bag, trial = tmp_path_factory.mktemp("recorded") / "bag", {"trial.participant": "P07", "trial.condition": "soft"}
    process = nodes.have("haptic_recorder", bag=str(bag), **trial, **{"trial.fields": ["hand=left", "age=31"]})
    with contextlib.closing(Speaker(ros_domain)) as speaker:
        speaker.publish(bag, "encoder", 200)
        speaker.publish(bag, "something_new", 5)
        before = time.time_ns()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(mark, "PATIENCE", LIMIT)
            mark.mark("über den Rand")
        after = time.time_ns()
        assert speaker.trigger("mark", "haptic_recorder")[0]
        until(lambda: len(load(bag).marks) > 1, "the second mark on the disk")
        [file] = bag.glob("*.mcap")
        speaker.until(lambda: STIFFNESS.encode() in file.read_bytes(), f"{STIFFNESS} in the bag")
        assert process.poll() is None
        assert nodes.end("haptic_recorder") == 0
    return bag, before, after


def test_every_message_is_kept_in_order_with_its_times_and_none_counted_lost(recorded):
    bag = recorded[0]
    assert np.array_equal(numbers(bag, "encoder"), np.arange(200))
    assert np.array_equal(numbers(bag, "something_new"), np.arange(5))
    encoder = joint(bag, "encoder")
    assert np.array_equal(encoder.entry("y"), -encoder.entry("x"))
    assert np.all(np.diff(encoder.sequence) == 1) and np.all(np.diff(encoder.published) > 0)
    assert np.all(encoder.received >= encoder.published)
    with AnyReader([bag]) as reader:
        offered = {connection.topic: connection.ext.offered_qos_profiles for connection in reader.connections}
    assert custom_data(bag)["lost /haptic/encoder"] == "0"
    assert offered["/haptic/encoder"][0].reliability.name == "BEST_EFFORT"


def test_a_mark_stands_in_the_bag_when_it_was_set_with_text_or_by_the_button(recorded):
    bag, before, after = recorded
    text, *buttons = load(bag).marks
    assert text.text == "über den Rand" and before < text.time < after
    assert buttons and [one.text for one in buttons] == [f"mark {k + 1}" for k in range(len(buttons))]


def test_a_bag_says_how_it_was_made(recorded):
    bag = recorded[0]
    attached = {name: yaml.safe_load(data) for name, data in load(bag).attachments.items()}
    assert attached["trial.yaml"] == {"participant": "P07", "condition": "soft", "hand": "left", "age": "31"}
    assert attached["made.yaml"]["machine"]["cores"] == os.cpu_count()
    assert attached["made.yaml"]["packages"]["numpy"] == np.__version__
    given = attached["parameters/publisher.yaml"]["/haptic/publisher"]["ros__parameters"]
    assert given[STIFFNESS] == 750.0
    assert custom_data(bag)["participant"] == "P07"


REFUSED = {
    "disk full": ({"disk_reserve": 1e6}, "MB free; disk_reserve needs 1000000 MB"),
    "folder in use": ({}, "is not empty"),
}


def test_what_a_recorder_cannot_do_is_refused_in_a_sentence_and_a_folder_in_use_not_written_into(start, tmp_path):
    """Each in a process of its own, all at once."""
    (tmp_path / "folder in use").mkdir()
    (tmp_path / "folder in use" / "notes.txt").write_text("mine")
    started = {
        wrong: start(command("haptic_recorder", bag=str(tmp_path / wrong), **given), stderr=subprocess.PIPE)
        for wrong, (given, _) in REFUSED.items()
    }
    for wrong, process in started.items():
        assert REFUSED[wrong][1] in refusal_of(process)  # all that haptic record shows
    assert [path.name for path in (tmp_path / "folder in use").iterdir()] == ["notes.txt"]
