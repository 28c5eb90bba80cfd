# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder alive, between a publisher in this process and a bag on the disk."""

import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
import rclpy
import yaml
from bag_of_a_run import joints
from rclpy.context import Context
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState

from haptic_device.analysis.recording import load
from haptic_sim.cli.domain import isolated_domain
from haptic_sim.cli.processes import NodeDiedError, Nodes, Program

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.fixture
def domain(tmp_path_factory):
    with isolated_domain(tmp_path_factory.mktemp("domain")) as number:
        yield number


@pytest.fixture
def node(domain):
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("publisher", namespace="/haptic", context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


def recorder(bag, **parameters) -> Program:
    return Program("haptic_recorder", "haptic_device.node.recorder", {"bag": str(bag), **parameters})


def wait_for(condition, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "what was waited for did not come"
        time.sleep(0.02)


def publish(node, topic: str, count: int, rate: float = 1000.0):
    """Publishes numbered samples once the recorder listens; it learns of the publisher a moment after we of it."""
    publisher = node.create_publisher(JointState, topic, BEST_EFFORT)
    wait_for(lambda: publisher.get_subscription_count() > 0)
    time.sleep(1.0)
    for number in range(count):
        publisher.publish(joints(("x", "y"), [number, -number], time.time_ns()))
        time.sleep(1 / rate)
    return publisher


def losses(bag) -> str:
    information = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    return information["custom_data"]["lost /haptic/encoder"]


def test_every_message_is_kept_in_order_with_its_times_and_none_counted_lost(node, tmp_path):
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(recorder(tmp_path / "bag"))
        publish(node, "encoder", 500)
        publish(node, "something_new", 5, rate=10)
        time.sleep(0.3)
        nodes.check()
    recording = load(tmp_path / "bag")
    encoder = recording.joint("encoder")
    assert np.array_equal(encoder.entry("x"), np.arange(500)) and np.array_equal(encoder.entry("y"), -np.arange(500))
    assert np.all(np.diff(encoder.sequence) == 1) and np.all(np.diff(encoder.published) > 0)
    assert np.all(encoder.received >= encoder.published)
    assert len(recording.joint("something_new").sequence) == 5
    with AnyReader([tmp_path / "bag"]) as reader:
        offered = {connection.topic: connection.ext.offered_qos_profiles for connection in reader.connections}
    assert losses(tmp_path / "bag") == "0" and offered["/haptic/encoder"][0].reliability.name == "BEST_EFFORT"


def test_messages_that_the_queue_could_not_hold_are_counted_lost(node, tmp_path):
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(recorder(tmp_path / "bag", queue=2, look_period=0.5))
        publish(node, "encoder", 1500)  # over several looks: only between two of them can a gap be seen
        time.sleep(0.6)
    kept = load(tmp_path / "bag").joint("encoder").sequence
    lost = int(losses(tmp_path / "bag"))
    assert lost > 0 and lost == kept[-1] - kept[0] + 1 - len(kept)


def test_a_killed_recorder_has_kept_all_but_the_last_second(node, tmp_path):
    bag = tmp_path / "bag"
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(recorder(bag))
        publish(node, "encoder", 1000)
        killed = time.time_ns()
        os.kill(nodes.pid("haptic_recorder"), signal.SIGKILL)
        wait_for(lambda: os.waitid(os.P_PID, nodes.pid("haptic_recorder"), os.WEXITED | os.WNOHANG | os.WNOWAIT))
        with pytest.raises(NodeDiedError, match="haptic_recorder ended with exit code -9"):
            nodes.check()
    encoder = load(bag).joint("encoder")
    assert 0 <= killed - encoder.received[-1] < 1_000_000_000
    assert len(encoder.sequence) > 500 and np.all(np.diff(encoder.entry("x")) == 1)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_recorder_asked_to_end_leaves_a_complete_bag(domain, tmp_path, number):
    command = recorder(tmp_path / "bag").command()
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=dict(os.environ))
    wait_for(lambda: list(tmp_path.glob("bag/*.mcap")))
    time.sleep(0.3)
    process.send_signal(number)
    _, said = process.communicate(timeout=10)
    assert process.returncode == 0 and "Traceback" not in said
    assert sorted(path.name for path in (tmp_path / "bag").iterdir()) == ["bag_0.mcap", "metadata.yaml"]


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"flush_period": 5.0}, "flush_period is 5.0 s"),
        ({"flush_perod": 0.1}, "flush_perod"),
        ({"queue": 0}, "queue is 0 messages"),
    ],
)
def test_a_wrong_parameter_is_refused_in_a_sentence(domain, tmp_path, parameters, sentence):
    command = recorder(tmp_path / "bag", **parameters).command()
    ended = subprocess.run(command, capture_output=True, text=True, timeout=20)
    assert ended.returncode == 1 and sentence in ended.stderr and "Traceback" not in ended.stderr


def test_a_folder_in_use_is_not_written_into(domain, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    ended = subprocess.run(recorder(tmp_path).command(), capture_output=True, text=True, timeout=20)
    assert ended.returncode == 1 and "is not empty" in ended.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


_PARENT = """
import sys, time
from pathlib import Path
from haptic_sim.cli.processes import Nodes, Program
nodes = Nodes(Path(sys.argv[1]))
nodes.start(Program("haptic_recorder", "haptic_device.node.recorder", {"bag": sys.argv[2]}))
print(nodes.pid("haptic_recorder"), flush=True)
time.sleep(60)
"""


def test_no_node_outlives_a_parent_that_was_killed(domain, tmp_path):
    bag = tmp_path / "bag"
    parent = subprocess.Popen(
        [sys.executable, "-c", _PARENT, str(tmp_path / "log"), str(bag)], stdout=subprocess.PIPE, text=True
    )
    child = int(parent.stdout.readline())
    wait_for(lambda: list(bag.glob("*.mcap")))
    parent.kill()
    parent.wait()
    wait_for(lambda: not psutil.pid_exists(child) or psutil.Process(child).status() == psutil.STATUS_ZOMBIE)
    wait_for(lambda: (bag / "metadata.yaml").exists())


_RECORD = "import typer; from haptic_sim.cli.record import record; typer.run(record)"


def test_the_record_command_ends_on_ctrl_c_with_a_line_for_each_topic(node, tmp_path):
    command = [sys.executable, "-c", _RECORD, "--out", str(tmp_path / "out")]
    recording = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    publish(node, "motor", 50)
    recording.send_signal(signal.SIGINT)
    said, _ = recording.communicate(timeout=15)
    assert recording.returncode == 0
    assert re.search(r"/haptic/motor +50 messages, lost: 0", said)
