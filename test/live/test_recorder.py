# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder alive: what it loses is counted, states and publishers come and go, and commands beside it."""

import contextlib
import re
import signal
import subprocess
import sys

import numpy as np
import pytest
import rclpy
from lifecycle_msgs.msg import State, Transition
from live_nodes import command
from rclpy.qos import QoSProfile, ReliabilityPolicy
from speaker import BURST, STIFFNESS, Speaker, custom_data, joint, kept, numbers
from std_msgs.msg import String
from waiting import exit_code, output

from haptic_display.cli import mark, record

RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


@pytest.fixture
def speaker(ros_domain):
    """One that nobody has asked anything yet: requests of recorders that have ended wait before no new one's."""
    with contextlib.closing(Speaker(ros_domain)) as speaker:
        yield speaker


@pytest.fixture
def recorder(nodes, tmp_path):
    """recorder(**parameters) runs until end(), which is well; into the folder `bag`."""

    class Recorder:
        bag = tmp_path / "bag"

        def begin(self, **parameters):
            self.log = nodes.have("haptic_recorder", bag=str(self.bag), **parameters).log

        def end(self):
            assert nodes.running["haptic_recorder"].poll() is None
            assert nodes.end("haptic_recorder") == 0
            return custom_data(self.bag)

    yield Recorder()
    nodes.lack("haptic_recorder")


def test_messages_that_the_queue_could_not_hold_are_counted_lost(speaker, recorder):
    recorder.begin(queue=2, look_period=0.5)
    speaker.meet(recorder.bag, "encoder")

    def gap():
        """Whether one was seen; only between two looks can it be."""
        speaker.say("encoder", *range(BURST))
        return np.any(np.diff(joint(recorder.bag, "encoder").sequence) > 1)

    speaker.until(gap, "a gap in the numbers of the publisher")
    lost, sequence = int(recorder.end()["lost /haptic/encoder"]), joint(recorder.bag, "encoder").sequence
    assert lost > 0 and lost == sequence[-1] - sequence[0] + 1 - len(sequence)


_RECORD = "import typer; from haptic_display.cli.record import record; typer.run(record)"


def test_the_record_command_ends_on_ctrl_c_with_a_line_for_each_topic(speaker, start, tmp_path):
    recording = start([sys.executable, "-c", _RECORD, "--out", tmp_path / "out"], stdout=subprocess.PIPE)
    speaker.publish(tmp_path / "out" / "bag", "motor", 50)
    recording.send_signal(signal.SIGINT)
    said, _ = output(recording)
    assert recording.returncode == 0
    count = len(kept(tmp_path / "out" / "bag", "motor"))
    assert count > 50 and re.search(rf"/haptic/motor +{count} messages, lost: 0", said)


def test_without_a_bag_the_record_command_and_without_a_recorder_a_mark_is_refused_in_a_sentence(
    ros_domain, tmp_path, monkeypatch
):
    def interrupt(nodes, program):
        raise KeyboardInterrupt

    monkeypatch.setattr(record.Nodes, "start", interrupt)
    with pytest.raises(ValueError, match="no whole bag is in"):
        record.record(tmp_path / "out")
    monkeypatch.setattr(mark, "PATIENCE", 0.5)
    with pytest.raises(ValueError, match="no haptic_recorder listens on /haptic/mark"):
        mark.mark("lost")


def test_a_recorder_that_is_shut_down_has_ended_its_bag_and_writes_no_more(speaker, recorder):
    recorder.begin()
    speaker.publish(recorder.bag, "encoder", 20)
    speaker.change("haptic_recorder", Transition.TRANSITION_ACTIVE_SHUTDOWN, State.PRIMARY_STATE_FINALIZED)
    ended = sorted(path.name for path in recorder.bag.iterdir())
    speaker.say("encoder", *range(20, 30))
    marked, _ = speaker.trigger("mark", "haptic_recorder")
    recorder.end()
    assert ended == ["bag_0.mcap", "metadata.yaml"]
    assert np.array_equal(numbers(recorder.bag, "encoder"), np.arange(20)) and not marked


def test_each_bag_holds_the_parameters_that_a_node_has_while_it_is_written(speaker, start, tmp_path):
    def newest():
        bags = sorted(tmp_path.glob("haptic_bags/*/*.mcap"))
        return bags[-1].read_bytes() if bags else b""

    process = start(command("haptic_recorder", bag="", autostart=False), cwd=tmp_path)
    speaker.change("haptic_recorder", Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE)
    for value in (900.0, 750.0):
        speaker.node.set_parameters([rclpy.parameter.Parameter(STIFFNESS, value=value)])
        speaker.change("haptic_recorder", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
        wanted = f"{STIFFNESS}: {value}".encode()
        speaker.until(lambda wanted=wanted: wanted in newest(), f"{STIFFNESS} {value} in the newest bag")
        speaker.change("haptic_recorder", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
        assert wanted in newest()
    assert f"{STIFFNESS}: 900.0".encode() not in newest()
    process.terminate()
    assert exit_code(process) == 0
    assert len(list(tmp_path.glob("haptic_bags/*/metadata.yaml"))) == 2


def test_a_publisher_that_comes_back_as_best_effort_is_joined_again_and_none_of_its_messages_is_missing(
    speaker, recorder
):
    recorder.begin()
    speaker.publish(recorder.bag, "encoder", 1)  # by which the bag is known to be one of ours
    for topic in ("own_topic", "joint_states"):  # one that was discovered, one joined beforehand
        speaker.begin(topic, RELIABLE)
        speaker.publish(recorder.bag, topic, 20)
        speaker.end(topic)
        speaker.meet(recorder.bag, topic, 1000.0)
        speaker.say(topic, *range(2000, 2020))
        speaker.until(lambda topic=topic: 2019.0 in kept(recorder.bag, topic), "the last message")
        assert np.array_equal([x for x in numbers(recorder.bag, topic) if x < 1000.0], np.arange(20))
        assert np.array_equal([x for x in numbers(recorder.bag, topic) if x >= 2000.0], np.arange(2000, 2020))
    recorder.end()


def test_a_publisher_that_comes_back_as_another_type_is_said_in_the_bag(ros_domain, speaker, recorder):
    recorder.begin()
    speaker.publish(recorder.bag, "encoder", 1)
    speaker.publish(recorder.bag, "own_topic", 20)
    speaker.end("own_topic")
    sentence = "std_msgs/msg/String is not recorded: the topic is sensor_msgs/msg/JointState"
    with contextlib.closing(Speaker(ros_domain)) as stranger:  # a node that knows no other type
        other = stranger.node.create_publisher(String, "own_topic", RELIABLE)
        speaker.until(lambda: sentence in recorder.log.read_text(), "the warning")
        other.publish(String(data="lost"))
        assert recorder.end()["not recorded /haptic/own_topic"] == sentence
    assert recorder.log.read_text().count(sentence) == 1
    assert np.array_equal(numbers(recorder.bag, "own_topic"), np.arange(20))


def test_a_named_bag_that_is_there_is_refused_and_the_recorder_stays_inactive(speaker, recorder):
    recorder.begin()
    speaker.publish(recorder.bag, "encoder", 20)
    speaker.change("haptic_recorder", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    before = sorted(path.name for path in recorder.bag.iterdir())
    with pytest.raises(AssertionError):
        speaker.change("haptic_recorder", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_INACTIVE)
    marked, said = speaker.trigger("mark", "haptic_recorder")
    assert not marked and said == f"cannot record: bag folder {recorder.bag} is not empty; name a new one"
    assert speaker.state("haptic_recorder") == State.PRIMARY_STATE_INACTIVE
    assert sorted(path.name for path in recorder.bag.iterdir()) == before
    recorder.end()
