# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder alive, between a publisher in this process and a bag on the disk."""

import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
import yaml
from bag_of_a_run import joints
from ear import Served
from lifecycle_msgs.msg import State, Transition
from live_nodes import command, refusal_of
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from waiting import LIMIT, exit_code, output, until

from haptic_device.recording import load
from haptic_sim.cli import mark, record

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
BURST = 50  # messages sent at once: far fewer than any queue on the way to the recorder holds
PROBE = -1.0  # x of the messages sent until the recorder is there
STIFFNESS = "coupling.stiffness"


class Speaker(Served):
    """Publishes numbered samples, and does so until the bag on the disk has them."""

    def __init__(self, ros_domain):
        super().__init__(ros_domain, "publisher")
        self._publishers = {}
        self.node.declare_parameter(STIFFNESS, 750.0)

    def look(self, seconds=0.05):  # a bag is read in that time
        super().look(seconds)

    def say(self, topic, *numbers):
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(JointState, topic, BEST_EFFORT)
        for number in numbers:
            self._publishers[topic].publish(joints(("x", "y"), [number, -number], time.time_ns()))

    def meet(self, bag, topic):
        """Publishes probes until the first of them is in the bag."""

        def there():
            self.say(topic, PROBE)
            return len(kept(bag, topic))

        self.until(there, f"a message of {topic} in {bag}")

    def publish(self, bag, topic, count):
        """Publishes `count` numbered samples once the recorder hears, and waits until the last is on the disk."""
        self.meet(bag, topic)
        for first in range(0, count, BURST):
            last = min(count, first + BURST) - 1
            self.say(topic, *range(first, last + 1))
            self.until(lambda last=last: last in kept(bag, topic), f"message {last} of {topic} in {bag}")


@pytest.fixture(scope="module")
def speaker(ros_domain):
    speaker = Speaker(ros_domain)
    yield speaker
    speaker.close()


@pytest.fixture
def newcomer(ros_domain):
    """A speaker that nobody has asked anything yet: requests of recorders that have ended wait before no new one's."""
    newcomer = Speaker(ros_domain)
    yield newcomer
    newcomer.close()


@pytest.fixture(autouse=True)
def ended(nodes):
    """No recorder is left to the next test."""
    yield
    nodes.lack("haptic_recorder")


def begun(nodes, bag, **parameters):
    """A recorder that writes into this bag; parameters with `__` for a dot."""
    return nodes.have("haptic_recorder", bag=str(bag), **parameters)


def recorder(bag, **parameters):
    return command("haptic_recorder", bag=str(bag), **parameters)


def well(nodes):
    """The recorder runs, and has said nothing bad."""
    process = nodes.running["haptic_recorder"]
    assert process.poll() is None and "Traceback" not in process.log.read_text()


def joint(bag, topic):
    """What is on the disk of a topic, of a bag that may still be written; None if there is nothing yet."""
    try:
        return load(bag).joint(topic)
    except (ValueError, OSError):
        return None


def kept(bag, topic):
    """Entry x of every message of a topic on the disk."""
    found = joint(bag, topic)
    return np.zeros(0) if found is None else found.entry("x")


def numbers(bag, topic):
    """The same without the probes."""
    found = kept(bag, topic)
    return found[found != PROBE]


def losses(bag) -> str:
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    return information["custom_data"]["lost /haptic/encoder"]


def files(bag):
    return list(bag.glob("*.mcap"))


@pytest.fixture(scope="module")
def recorded(speaker, nodes, tmp_path_factory):
    """(bag, time before and after its first mark [ns]) of a recorder that has ended well."""
    bag, trial = tmp_path_factory.mktemp("recorded") / "bag", {"trial.participant": "P07", "trial.condition": "soft"}
    begun(nodes, bag, **trial, **{"trial.fields": ["hand=left", "age=31"]})
    speaker.publish(bag, "encoder", 200)
    speaker.publish(bag, "something_new", 5)
    before = time.time_ns()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mark, "PATIENCE", LIMIT)
        mark.mark("über den Rand")
    after = time.time_ns()
    assert speaker.trigger("mark", "haptic_recorder")[0]
    until(lambda: len(load(bag).marks) > 1, "the second mark on the disk")
    speaker.until(lambda: STIFFNESS.encode() in files(bag)[0].read_bytes(), f"{STIFFNESS} in the bag")
    well(nodes)
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
    assert losses(bag) == "0" and offered["/haptic/encoder"][0].reliability.name == "BEST_EFFORT"


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
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["custom_data"]["participant"] == "P07"


def test_messages_that_the_queue_could_not_hold_are_counted_lost(speaker, nodes, tmp_path):
    bag = tmp_path / "bag"
    begun(nodes, bag, queue=2, look_period=0.5)
    speaker.meet(bag, "encoder")

    def gap():
        """Whether one was seen; only between two looks can it be."""
        speaker.say("encoder", *range(BURST))
        return np.any(np.diff(joint(bag, "encoder").sequence) > 1)

    speaker.until(gap, "a gap in the numbers of the publisher")
    assert nodes.end("haptic_recorder") == 0
    sequence, lost = joint(bag, "encoder").sequence, int(losses(bag))
    assert lost > 0 and lost == sequence[-1] - sequence[0] + 1 - len(sequence)


@pytest.mark.parametrize("wish", ["prefer", "off"])
def test_a_real_time_recorder_keeps_to_its_first_core_and_an_ordinary_one_may_run_on_all(nodes, tmp_path, wish):
    every = os.sched_getaffinity(0)
    pid = begun(nodes, tmp_path / "bag", realtime=wish).pid
    until(lambda: files(tmp_path / "bag"), "the bag")
    urgent = os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_RR
    cores = [os.sched_getaffinity(int(thread)) for thread in os.listdir(f"/proc/{pid}/task")]
    assert len(cores) > 1 and all(allowed == ({min(every)} if urgent else every) for allowed in cores)
    assert wish == "prefer" or not urgent


REFUSED = {
    "field without a value": ({"trial.fields": ["left"]}, "'left'; write name=value"),
    "disk full": ({"disk_reserve": 1e6}, "MB free; disk_reserve needs 1000017 MB"),
    "folder in use": ({}, "is not empty"),
}


def test_what_a_recorder_cannot_do_is_refused_in_a_sentence_and_a_folder_in_use_not_written_into(start, tmp_path):
    """Each in a process of its own, all at once."""
    (tmp_path / "folder in use").mkdir()
    (tmp_path / "folder in use" / "notes.txt").write_text("mine")
    started = {
        wrong: start(recorder(tmp_path / wrong, **given), stderr=subprocess.PIPE)
        for wrong, (given, _) in REFUSED.items()
    }
    for wrong, process in started.items():
        assert REFUSED[wrong][1] in refusal_of(process)  # all that haptic record shows
    assert [path.name for path in (tmp_path / "folder in use").iterdir()] == ["notes.txt"]


_RECORD = "import typer; from haptic_sim.cli.record import record; typer.run(record)"


def test_the_record_command_ends_on_ctrl_c_with_a_line_for_each_topic(speaker, start, tmp_path):
    command = [sys.executable, "-c", _RECORD, "--out", tmp_path / "out"]
    recording = start(command, stdout=subprocess.PIPE)
    speaker.publish(tmp_path / "out" / "bag", "motor", 50)
    recording.send_signal(signal.SIGINT)
    said, _ = output(recording)
    assert recording.returncode == 0
    count = len(kept(tmp_path / "out" / "bag", "motor"))
    assert count > 50 and re.search(rf"/haptic/motor +{count} messages, lost: 0", said)


def test_the_record_command_ended_before_it_began_says_that_there_is_no_bag(ros_domain, tmp_path, monkeypatch):
    def interrupt(nodes, program):
        raise KeyboardInterrupt

    monkeypatch.setattr(record.Nodes, "start", interrupt)
    with pytest.raises(ValueError, match="no whole bag is in"):
        record.record(tmp_path / "out")


def test_a_mark_that_nobody_records_is_refused_in_a_sentence(ros_domain, monkeypatch):
    monkeypatch.setattr(mark, "PATIENCE", 0.5)
    with pytest.raises(ValueError, match="no haptic_recorder listens on /haptic/mark"):
        mark.mark("lost")


def test_a_recorder_that_is_shut_down_has_ended_its_bag_and_writes_no_more(newcomer, nodes, tmp_path):
    bag = tmp_path / "bag"
    begun(nodes, bag)
    newcomer.publish(bag, "encoder", 20)
    newcomer.change("haptic_recorder", Transition.TRANSITION_ACTIVE_SHUTDOWN, State.PRIMARY_STATE_FINALIZED)
    ended = sorted(path.name for path in bag.iterdir())
    newcomer.say("encoder", *range(20, 30))
    marked, _ = newcomer.trigger("mark", "haptic_recorder")
    well(nodes)
    assert nodes.end("haptic_recorder") == 0
    assert ended == ["bag_0.mcap", "metadata.yaml"]
    assert np.array_equal(numbers(bag, "encoder"), np.arange(20)) and not marked


def test_each_bag_holds_the_parameters_that_a_node_has_while_it_is_written(newcomer, start, tmp_path):
    def newest():
        bags = sorted(tmp_path.glob("haptic_bags/*/*.mcap"))
        return bags[-1].read_bytes() if bags else b""

    process = start(recorder("", autostart=False), cwd=tmp_path)
    newcomer.change("haptic_recorder", Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE)
    for value in (900.0, 750.0):
        newcomer.node.set_parameters([rclpy.parameter.Parameter(STIFFNESS, value=value)])
        newcomer.change("haptic_recorder", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
        wanted = f"{STIFFNESS}: {value}".encode()
        newcomer.until(lambda wanted=wanted: wanted in newest(), f"{STIFFNESS} {value} in the newest bag")
        newcomer.change("haptic_recorder", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
        assert wanted in newest()
    assert f"{STIFFNESS}: 900.0".encode() not in newest()
    process.terminate()
    assert exit_code(process) == 0
    assert len(list(tmp_path.glob("haptic_bags/*/metadata.yaml"))) == 2


def custom_data(bag):
    return yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["custom_data"]


RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


@pytest.mark.parametrize("topic", ["own_topic", "joint_states"])  # one that was discovered, one joined beforehand
def test_a_publisher_that_comes_back_as_best_effort_is_joined_again(newcomer, nodes, tmp_path, topic):
    bag, node = tmp_path / "bag", newcomer.node
    begun(nodes, bag)
    newcomer.publish(bag, "encoder", 1)  # by which the bag is known to be one of ours
    newcomer._publishers[topic] = node.create_publisher(JointState, topic, RELIABLE)
    newcomer.publish(bag, topic, 20)
    node.destroy_publisher(newcomer._publishers.pop(topic))
    sent = 0

    def heard():
        """One message more of the publisher that is new."""
        nonlocal sent
        sent += 1
        newcomer.say(topic, 1000 + sent)
        return np.any(kept(bag, topic) > 1000)

    newcomer.until(heard, f"a message of the new publisher of {topic}")
    newcomer.say(topic, *range(2000, 2020))
    newcomer.until(lambda: 2019.0 in kept(bag, topic), "the last message")
    well(nodes)
    assert nodes.end("haptic_recorder") == 0
    assert np.array_equal([x for x in kept(bag, topic) if 0.0 <= x < 1000.0], np.arange(20))
    lost = custom_data(bag)[f"lost /haptic/{topic}"]
    after = [x for x in kept(bag, topic) if 1000.0 < x < 2000.0]
    assert lost in (str(sent - len(after)), "unknown, several publishers"), (lost, sent, after)


def test_a_publisher_that_comes_back_as_another_type_is_said_in_the_bag(speaker, newcomer, nodes, tmp_path):
    from std_msgs.msg import String

    bag = tmp_path / "bag"
    process = begun(nodes, bag)
    newcomer.publish(bag, "encoder", 1)
    newcomer.publish(bag, "own_topic", 20)
    newcomer.node.destroy_publisher(newcomer._publishers.pop("own_topic"))
    other = speaker.node.create_publisher(String, "own_topic", RELIABLE)  # of a node that knows no other type
    sentence = "std_msgs/msg/String is not recorded: the topic is sensor_msgs/msg/JointState"
    newcomer.until(lambda: sentence in process.log.read_text(), "the warning")
    other.publish(String(data="lost"))
    well(nodes)
    assert nodes.end("haptic_recorder") == 0
    speaker.node.destroy_publisher(other)
    assert custom_data(bag)["not recorded /haptic/own_topic"] == sentence
    assert process.log.read_text().count(sentence) == 1 and np.array_equal(numbers(bag, "own_topic"), np.arange(20))


def test_a_named_bag_that_is_there_is_refused_and_the_recorder_stays_inactive(newcomer, nodes, tmp_path):
    bag = tmp_path / "bag"
    begun(nodes, bag)
    newcomer.publish(bag, "encoder", 20)
    newcomer.change("haptic_recorder", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    before = sorted(path.name for path in bag.iterdir())
    with pytest.raises(AssertionError):
        newcomer.change("haptic_recorder", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_INACTIVE)
    well(nodes)
    marked, said = newcomer.trigger("mark", "haptic_recorder")
    assert not marked and said == f"cannot record: bag folder {bag} is not empty; name a new one"
    assert newcomer.state("haptic_recorder") == State.PRIMARY_STATE_INACTIVE
    assert sorted(path.name for path in bag.iterdir()) == before
    assert nodes.end("haptic_recorder") == 0
