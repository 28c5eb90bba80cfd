# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder alive, between a publisher in this process and a bag on the disk."""

import os
import re
import resource
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
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from haptic_device.analysis.recording import load
from haptic_sim.cli.domain import isolated_domain
from haptic_sim.cli.processes import NodeDiedError, Nodes, Program

pytestmark = pytest.mark.live

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


def wait_for(condition, seconds: float = 60.0) -> None:
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


@pytest.mark.parametrize("wish", ["prefer", "off"])
def test_a_real_time_recorder_keeps_to_its_first_core_and_an_ordinary_one_may_run_on_all(domain, tmp_path, wish):
    every = os.sched_getaffinity(0)
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(recorder(tmp_path / "bag", realtime=wish))
        wait_for(lambda: list(tmp_path.glob("bag/*.mcap")))
        pid = nodes.pid("haptic_recorder")
        urgent = os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO
        cores = [os.sched_getaffinity(int(thread)) for thread in os.listdir(f"/proc/{pid}/task")]
    assert len(cores) > 1 and all(allowed == ({min(every)} if urgent else every) for allowed in cores)
    assert wish == "prefer" or not urgent


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
    assert ended.returncode == 1 and "is not empty" in ended.stderr.splitlines()[-1]  # all that haptic record shows
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


def test_the_record_command_ended_before_it_began_says_that_there_is_no_bag(domain, tmp_path, monkeypatch):
    from haptic_sim.cli import record

    def interrupt(nodes, program):
        raise KeyboardInterrupt

    monkeypatch.setattr(record.Nodes, "start", interrupt)
    with pytest.raises(ValueError, match="no whole bag is in"):
        record.record(tmp_path / "out")


def run_main(*words, **given):
    command = [sys.executable, "-m", "haptic_sim.cli.main", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=90, **given)


def test_a_mark_stands_in_the_bag_when_it_was_set_with_text_or_by_the_button(node, tmp_path):
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(recorder(tmp_path / "bag"))
        publish(node, "encoder", 20)
        before = time.time_ns()
        assert run_main("mark", "über den Rand").returncode == 0
        after = time.time_ns()
        client = node.create_client(Trigger, "haptic_recorder/mark")
        wait_for(client.service_is_ready)
        answer = client.call_async(Trigger.Request())
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        wait_for(lambda: executor.spin_once(timeout_sec=0.05) or answer.done())
        time.sleep(0.3)
        nodes.check()
    text, button = load(tmp_path / "bag").marks
    assert text.text == "über den Rand" and before < text.time < after
    assert (answer.result().success, button.text) == (True, "mark 1")


def test_a_mark_that_nobody_records_is_refused_in_a_sentence(domain, monkeypatch):
    from haptic_sim.cli import mark

    monkeypatch.setattr(mark, "PATIENCE", 0.5)
    with pytest.raises(ValueError, match="no haptic_recorder listens on /haptic/mark"):
        mark.mark("lost")


def test_a_bag_says_how_it_was_made(node, tmp_path):
    trial = {"trial.participant": "P07", "trial.condition": "soft", "trial.fields": ["hand=left", "age=31"]}
    node.declare_parameter("coupling.stiffness", 750.0)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(recorder(tmp_path / "bag", **trial))
        wait_for(lambda: executor.spin_once(timeout_sec=0.05) or list(tmp_path.glob("bag/*.mcap")))
        end = time.monotonic() + 60.0
        while b"coupling.stiffness" not in next(tmp_path.glob("bag/*.mcap")).read_bytes() and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.05)
        publish(node, "encoder", 20)
        nodes.check()
    attached = {name: yaml.safe_load(data) for name, data in load(tmp_path / "bag").attachments.items()}
    assert attached["trial.yaml"] == {"participant": "P07", "condition": "soft", "hand": "left", "age": "31"}
    assert attached["made.yaml"]["machine"]["cores"] == os.cpu_count()
    assert attached["made.yaml"]["packages"]["numpy"] == np.__version__
    given = attached["parameters/publisher.yaml"]["/haptic/publisher"]["ros__parameters"]
    assert given["coupling.stiffness"] == 750.0
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["custom_data"]["participant"] == "P07"


def test_each_bag_holds_the_parameters_that_a_node_has_while_it_is_written(node, tmp_path):
    node.declare_parameter("coupling.stiffness", 750.0)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    switch = node.create_client(ChangeState, "haptic_recorder/change_state")

    def until(condition):
        wait_for(lambda: executor.spin_once(timeout_sec=0.05) or condition())

    def order(number):
        answer = switch.call_async(ChangeState.Request(transition=Transition(id=number)))
        until(answer.done)
        assert answer.result().success

    def newest():
        return max(tmp_path.glob("haptic_bags/*/*.mcap")).read_bytes()

    process = subprocess.Popen(recorder("", autostart=False).command(), cwd=tmp_path)
    try:
        until(switch.service_is_ready)
        order(Transition.TRANSITION_CONFIGURE)
        for value in (750.0, 900.0):
            node.set_parameters([rclpy.parameter.Parameter("coupling.stiffness", value=value)])
            order(Transition.TRANSITION_ACTIVATE)
            until(lambda: b"coupling.stiffness: " in newest())
            order(Transition.TRANSITION_DEACTIVATE)
            assert f"coupling.stiffness: {value}".encode() in newest()
            time.sleep(1.1)  # the next bag's name is the next second's
        assert b"coupling.stiffness: 750.0" not in newest()
    finally:
        process.terminate()
        process.wait(20)
    assert len(list(tmp_path.glob("haptic_bags/*/metadata.yaml"))) == 2


def test_a_field_without_a_value_is_refused_in_a_sentence(domain, tmp_path):
    command = recorder(tmp_path / "bag", **{"trial.fields": ["left"]}).command()
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1 and "'left'; write name=value" in ended.stderr and "Traceback" not in ended.stderr


def flood(node, seconds=90.0):
    """Publishes what does not compress until told."""
    publisher = node.create_publisher(JointState, "encoder", BEST_EFFORT)
    wait_for(lambda: publisher.get_subscription_count() > 0)
    random = np.random.default_rng(1)
    message = JointState(name=[f"n{i}" for i in range(200)])
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        message.position, message.velocity = random.normal(size=(2, 200)).tolist()
        publisher.publish(message)
        time.sleep(0.002)
        yield


def test_a_disk_that_takes_no_more_ends_the_bag_which_keeps_what_it_has(node, tmp_path):
    limit = 6 * 2**20  # bytes of one file that the operating system allows the recorder
    process = subprocess.Popen(
        recorder(tmp_path / "bag").command(),
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    for _ in flood(node):
        if process.poll() is not None:
            break
    _, said = process.communicate(timeout=20)
    assert process.returncode == 1 and "Traceback" not in said
    assert "recording stopped: the bag could not be written: File too large" in said
    kept = load(tmp_path / "bag").joint("encoder").sequence
    assert len(kept) > 500 and np.all(np.diff(kept) >= 1)
    with AnyReader([tmp_path / "bag"]) as reader:
        assert sum(1 for _ in reader.messages()) == sum(found.msgcount for found in reader.connections)


_NEARLY_FULL = """
import shutil, sys
from collections import namedtuple
from haptic_device.node import recorder
usage, looks = namedtuple("usage", "total used free"), []
def disk_usage(path):
    looks.append(path)
    return usage(0, 0, 10**12 if len(looks) < 4 else 150_000_000)
shutil.disk_usage = disk_usage
sys.exit(recorder.main())
"""


def test_a_disk_nearly_full_ends_the_bag_and_one_that_is_so_already_is_refused(domain, tmp_path):
    options = recorder(tmp_path / "bag").command()[3:]
    ended = subprocess.run([sys.executable, "-c", _NEARLY_FULL, *options], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1 and "Traceback" not in ended.stderr
    assert "the disk has 150 MB left, disk_reserve is 200 MB" in ended.stderr and "are kept in" in ended.stderr
    assert (tmp_path / "bag" / "metadata.yaml").exists()
    command = recorder(tmp_path / "other", disk_reserve=1e6).command()
    refused = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert refused.returncode == 1 and "MB free; disk_reserve needs 1000004 MB" in refused.stderr
