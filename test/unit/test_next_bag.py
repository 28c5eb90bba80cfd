# SPDX-License-Identifier: Apache-2.0
"""A recorder from one bag to the next, without a middleware: what ends a bag leaves nothing of it for the next one."""

import errno
import logging
from types import SimpleNamespace

import pytest
from bag_of_a_run import JOINTS, joints
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import Parameter

from haptic_device.nodes import recorder as module
from haptic_device.nodes.parameter_client import ParameterClient
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
    assert "recording stopped" in recorder.failure and "haptic recover" in recorder.failure
    recorder.bag, recorder.waiting = Bag(tmp_path / "second"), [5, 6]
    recorder.deactivate()
    assert "message_count: 2\n" in (tmp_path / "second" / "metadata.yaml").read_text()


def test_a_bag_that_a_full_disk_ends_says_what_was_lost(tmp_path, monkeypatch):
    recorder = Deaf()
    recorder._next_discovery, recorder._next_flush, recorder._fresh = 10**30, 0, {}
    recorder.values |= {"flush_period": 0.25, "disk_reserve": 0.0}
    recorder.bag, recorder.waiting = Bag(tmp_path / "bag"), [1, 2, 4]

    def refuse(bag):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Bag, "flush", refuse)
    recorder.look()
    assert recorder.bag is None and "No space left on device; 3 messages are kept" in recorder.failure
    assert "lost /haptic/encoder: '1'" in (tmp_path / "bag" / "metadata.yaml").read_text()


def test_a_write_that_fails_as_the_bag_is_ended_is_said_as_while_it_records(tmp_path, monkeypatch):
    recorder = Deaf()

    def refuse(*given):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(Bag, "write", refuse)
        recorder.bag, recorder.waiting = Bag(tmp_path / "bag"), [1]
        recorder.deactivate()
    assert "the bag could not be written: No space left on device; 0 messages are kept" in recorder.failure


def test_a_bag_of_which_nothing_can_be_said_is_ended_whole(tmp_path, monkeypatch):
    recorder = Deaf()

    def fail(recorder):
        raise RuntimeError("nobody foresaw this")

    monkeypatch.setattr(Deaf, "_facts", fail)
    recorder.bag, recorder.waiting = Bag(tmp_path / "bag"), [1, 2]
    recorder.deactivate()
    assert "recording stopped: RuntimeError: nobody foresaw this; 2 messages are kept" in recorder.failure
    assert "message_count: 2\n" in (tmp_path / "bag" / "metadata.yaml").read_text()


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


class Done:
    """An answer that is there at once."""

    def __init__(self, answer):
        self._answer = answer

    def add_done_callback(self, callback):
        callback(self)

    def result(self):
        return self._answer


class Graph:
    """A recorder's node that sees one other, with one parameter."""

    def __init__(self):
        self.value, self.clients = 100.0, []

    def get_name(self):
        return "haptic_recorder"

    def get_namespace(self):
        return "/haptic"

    def get_node_names_and_namespaces(self):
        return [("haptic_recorder", "/haptic"), ("haptic_driver", "/haptic")]

    def create_client(self, kind, name):
        client = SimpleNamespace(service_is_ready=lambda: True, call_async=lambda request: Done(self._answer(kind)))
        self.clients.append(client)
        return client

    def _answer(self, kind):
        if kind is ListParameters:
            answer = ListParameters.Response()
            answer.result.names = ["coupling.stiffness"]
            return answer
        return GetParameters.Response(values=[Parameter("coupling.stiffness", value=self.value).get_parameter_value()])


def test_nodes_are_asked_once_and_anew_by_the_same_clients_for_the_next_bag():
    graph, told = Graph(), []
    inquiry = ParameterClient(graph, lambda node, values: told.append((node, values["coupling.stiffness"])))
    inquiry.look()
    graph.value = 200.0
    inquiry.look()
    assert told == [("haptic_driver", 100.0)]
    inquiry.again()
    inquiry.look()
    assert told == [("haptic_driver", 100.0), ("haptic_driver", 200.0)] and len(graph.clients) == 2


def test_a_bag_without_a_name_gets_a_number_where_its_second_has_one_already(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(module, "time", SimpleNamespace(strftime=lambda form: "haptic_bags/20260101-120000"))
    recorder = Deaf()
    recorder.values["bag"] = ""
    names = []
    for _ in range(3):
        names.append(recorder._folder().name)
        recorder._folder().mkdir(parents=True)
    assert names == ["20260101-120000", "20260101-120000-2", "20260101-120000-3"]
