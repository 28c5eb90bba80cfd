# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder on a disk that fills, and with exceptions that nobody foresaw: the bag keeps what it has."""

import contextlib
import signal
import subprocess
import sys

import numpy as np
import pytest
from ear import Served
from live_nodes import command
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from waiting import output, run, until

from haptic_device.recording import load

pytestmark = pytest.mark.timeout(900)

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


def ros_arguments(bag):
    """Of the command line of a recorder."""
    return command("haptic_recorder", bag=str(bag))[3:]


def files(bag):
    return list(bag.glob("*.mcap"))


@pytest.fixture
def speaker(ros_domain):
    with contextlib.closing(Served(ros_domain, "publisher")) as speaker:
        yield speaker


# On a disk that takes so many bytes of a bag, and more only where its reserve was given back.
_FULL = """
import errno, os, sys
from haptic_device.nodes import recorder
from haptic_device.recording.writer import Reserve
limit, written, write, given, give_back = int(sys.argv.pop(1)), 0, os.write, [], Reserve.give_back
Reserve.give_back = lambda reserve: (given.append(True), give_back(reserve))
def filling(descriptor, data):
    global written
    if written > limit and not given:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    count = write(descriptor, data)
    written += count
    return count
os.write = filling
sys.exit(recorder.main())
"""


def test_a_disk_that_takes_no_more_ends_the_bag_which_keeps_what_it_has(speaker, start, tmp_path):
    bag, limit = tmp_path / "bag", 6 * 2**20
    command = [sys.executable, "-c", _FULL, str(limit), *ros_arguments(bag)]
    process = start(command, stderr=subprocess.PIPE)
    message, random = JointState(name=[f"n{i}" for i in range(1000)]), np.random.default_rng(1)
    publisher = speaker.node.create_publisher(JointState, "large", BEST_EFFORT)

    def flooded():
        """Publishes what does not compress."""
        for _ in range(10):
            message.position, message.velocity = random.normal(size=(2, 1000)).tolist()
            publisher.publish(message)
        return process.poll() is not None

    speaker.until(flooded, "the end of the recorder")
    speaker.node.destroy_publisher(publisher)
    _, said = output(process)
    assert process.returncode == 1 and "Traceback" not in said
    assert f"recording stopped: the bag could not be written: {bag / 'bag_0.mcap'}: No space left on device" in said
    assert sorted(path.name for path in bag.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    sequence = load(bag).joint("haptic/large").sequence
    assert np.all(np.diff(sequence) >= 1) and 2 * files(bag)[0].stat().st_size > limit
    with AnyReader([bag]) as reader:
        assert sum(1 for _ in reader.messages()) == sum(found.msgcount for found in reader.connections)


_NEARLY_FULL = """
import shutil, sys
from collections import namedtuple
from haptic_device.nodes import recorder
usage, looks = namedtuple("usage", "total used free"), []
def disk_usage(path):
    looks.append(path)
    return usage(0, 0, 10**12 if len(looks) < 4 else 150_000_000)
shutil.disk_usage = disk_usage
sys.exit(recorder.main())
"""


def test_a_disk_nearly_full_ends_the_bag(ros_domain, tmp_path):
    command = [sys.executable, "-c", _NEARLY_FULL, *ros_arguments(tmp_path / "bag")]
    ended = run(command)
    assert ended.returncode == 1 and "Traceback" not in ended.stderr
    assert "the disk has 150 MB left, disk_reserve is 200 MB" in ended.stderr and "are kept in" in ended.stderr
    assert (tmp_path / "bag" / "metadata.yaml").exists()


def test_a_bag_that_cannot_be_ended_is_said_to_be_so_and_the_recorder_has_failed(ros_domain, start, tmp_path):
    command = [sys.executable, "-c", _FAILING, str(tmp_path / "bag"), "close", *ros_arguments(tmp_path / "bag")]
    process = start(command, stderr=subprocess.PIPE)
    until(lambda: files(tmp_path / "bag"), "the bag")
    process.send_signal(signal.SIGINT)
    said = output(process)[1]
    assert process.returncode == 1 and "could not be ended (nobody foresaw this): haptic recover" in said, said
    assert "Traceback" not in said


_FAILING = """
import sys
from pathlib import Path
from haptic_device.nodes import parameter_client, polled_subscription, recorder
from haptic_device.recording import writer
bag, name = Path(sys.argv.pop(1)), sys.argv.pop(1)
owners = parameter_client.ParameterClient, polled_subscription.PolledSubscription, writer.Bag
owner = dict(zip(("look", "take", "close"), owners))[name]
does = getattr(owner, name)
def fails(self, *given):
    if any(bag.glob("*.mcap")):
        raise RuntimeError("nobody foresaw this")
    return does(self, *given)
setattr(owner, name, fails)
sys.exit(recorder.main())
"""


@pytest.mark.parametrize("part", ["look", "take"])  # of another node's parameters, and of a message
def test_an_exception_that_nobody_foresaw_ends_the_recorder_and_its_bag(ros_domain, tmp_path, part):
    bag = tmp_path / "bag"
    command = [sys.executable, "-c", _FAILING, str(bag), part, *ros_arguments(bag)]
    ended = run(command)
    assert ended.returncode == 1 and "nobody foresaw this" in ended.stderr
    assert sorted(path.name for path in bag.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
