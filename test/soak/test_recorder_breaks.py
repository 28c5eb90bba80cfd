# SPDX-License-Identifier: Apache-2.0
"""haptic_recorder on a disk nearly full, and with exceptions that nobody foresaw: its bag is ended, which is said."""

import signal
import subprocess
import sys

import pytest
from live_nodes import command
from waiting import output, run, until

pytestmark = pytest.mark.timeout(900)


def ros_arguments(bag):
    """Of the command line of a recorder."""
    return command("haptic_recorder", bag=str(bag))[3:]


def files(bag):
    return list(bag.glob("*.mcap"))


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
    assert process.returncode == 1 and "could not be ended (nobody foresaw this): haptic report reads" in said, said
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
