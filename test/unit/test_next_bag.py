# SPDX-License-Identifier: Apache-2.0
"""A recorder from one bag to the next, without a middleware: what ends a bag leaves nothing of it for the next one."""

import errno
import logging
from types import SimpleNamespace

import pytest
from bag_of_a_run import JOINTS, joints

from haptic_device.nodes import recorder as module
from haptic_device.nodes.polled_subscription import Sample
from haptic_device.nodes.recorded_topics import RecordedTopics, Track
from haptic_device.nodes.recorder import Recorder
from haptic_device.recording import load
from haptic_device.recording.writer import Bag


class Deaf(Recorder):
    """A recorder of one topic that hears what the test hands it."""

    def __init__(self):
        self.waiting = []
        heard = SimpleNamespace(topic="/haptic/encoder", type_name=JOINTS, take=self._heard)
        self.topics, self.bag, self.failure = RecordedTopics(self), None, ""
        self.topics.tracks[heard.topic] = Track(heard)
        self.values = {"trial.participant": "P7", "trial.condition": "", "trial.fields": []}

    def _heard(self):
        while self.waiting:
            sequence = self.waiting.pop(0)
            yield Sample(joints(("x",), [1.0], 0), sequence, sequence, sequence)

    def get_namespace(self):
        return "/haptic"

    def get_logger(self):
        return logging.getLogger("recorder")

    def get_publishers_info_by_topic(self, topic):
        return []


@pytest.mark.parametrize("way", ["told to end", "disk full"])
def test_a_bag_that_cannot_be_ended_leaves_the_next_one_whole(tmp_path, monkeypatch, way):
    recorder, said = Deaf(), []

    def refuse(bag, custom_data):
        said.append(custom_data)
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(Bag, "close", refuse)
        recorder.bag, recorder.waiting = Bag(tmp_path / "first"), [1, 2, 4]
        recorder._take(recorder.topics.tracks["/haptic/encoder"])
        recorder.deactivate() if way == "told to end" else recorder._end("the disk is full")
    assert recorder.bag is None and said[0]["lost /haptic/encoder"] == "1"
    assert "recording stopped" in recorder.failure
    assert f"ros2 bag reindex -s mcap {tmp_path / 'first'}" in recorder.failure
    recorder.bag, recorder.waiting = Bag(tmp_path / "second"), [5, 6]
    recorder.deactivate()
    assert "message_count: 2\n" in (tmp_path / "second" / "metadata.yaml").read_text()


def test_a_message_waits_for_the_disk_no_longer_than_the_flush_period_whatever_kills_the_recorder(
    tmp_path, monkeypatch
):
    recorder, now, heard, folder = Deaf(), 0, [], tmp_path / "bag"
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic_ns=lambda: now, time_ns=lambda: now))
    period, look = 250_000_000, 40_000_000  # [ns] as shipped
    recorder.values |= {"flush_period": period * 1e-9, "disk_reserve": 0.0}
    recorder._next_discovery, recorder._next_flush, recorder._fresh, recorder.bag = 10**18, 0, {}, Bag(folder)
    written = []
    for now in range(look, 40 * look, look):
        heard.append(now)
        recorder.waiting = [len(heard)]
        recorder.look()
        written.append(len(load(folder).joint("encoder").sequence))
        assert written[-1] >= sum(each <= now - period for each in heard)
    assert len(set(written)) < len(written) / 2  # and it is not written each time it is looked at
    recorder.deactivate()
