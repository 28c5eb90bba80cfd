# SPDX-License-Identifier: Apache-2.0
"""Variables of the environment that ROS would die of, or obey without a word: refused in one sentence."""

import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest
from in_process import haptic
from live_demo import HAPTIC
from live_nodes import MODULES

from haptic_device import process, ros_environment


@pytest.mark.parametrize(("given", "domain"), [(None, 0), ("", 0), ("0", 0), ("7", 7), ("232", 232)])
def test_a_domain_is_what_ros_takes_it_for(monkeypatch, given, domain):
    monkeypatch.delenv("ROS_DOMAIN_ID")
    if given is not None:
        monkeypatch.setenv("ROS_DOMAIN_ID", given)
    assert ros_environment.domain() == domain


@pytest.mark.parametrize("given", ["-1", "abc", "233", "300", "1.0", "0x10", "010", " 7", "99999999999999999999", "٣"])
def test_what_is_no_domain_or_one_that_ros_reads_otherwise_is_refused(monkeypatch, given):
    monkeypatch.setenv("ROS_DOMAIN_ID", given)
    with pytest.raises(ValueError) as refused:
        ros_environment.check()
    assert str(refused.value) == f"ROS_DOMAIN_ID is {given!r}; a whole number from 0 to 232 is needed"


def test_ros_without_a_folder_for_its_log_is_refused(monkeypatch, tmp_path):
    for name in ("ROS_LOG_DIR", "ROS_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ValueError, match="^HOME is not set, below which ROS keeps its log; set it, or ROS_LOG_DIR$"):
        ros_environment.check()
    (tmp_path / "file").touch()
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "file"))
    with pytest.raises(ValueError, match=r"file/log, which cannot be made \(Not a directory\); let ROS_LOG_DIR name"):
        ros_environment.check()
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    ros_environment.check()


def test_a_shared_memory_without_room_is_refused_before_ros_writes_there(monkeypatch, capsys):
    sizes = {"free": ros_environment.ROOM}
    monkeypatch.setattr(ros_environment.shutil, "disk_usage", lambda where: SimpleNamespace(**sizes))
    ros_environment.check_room()
    sizes["free"] -= 1
    with process.handling(signal.SIG_DFL):
        assert process.start("haptic_device.nodes.driver") == 1
    sentence = "/dev/shm has 63 kB free; ROS and the device's page need 64 kB there"
    assert capsys.readouterr().err == f"haptic_driver: {sentence}\n"
    assert haptic("demo").stderr == f"haptic: {sentence}\n"


RECORDER = [sys.executable, "-m", "haptic_device.nodes.recorder"]
JOINING = {
    "demo": [*HAPTIC, "demo", "--out", "run"],
    "record": [*HAPTIC, "record", "--out", "run"],
    "status": [*HAPTIC, "status", "--json"],
    "mark": [*HAPTIC, "mark", "now"],
    "view": [*HAPTIC, "view"],
    "recorder": RECORDER,
    "driver": [sys.executable, "-m", MODULES["haptic_driver"]],
}


@pytest.mark.parametrize("who", JOINING)
def test_who_joins_ros_ends_with_that_sentence_and_leaves_nothing(tmp_path, who):
    environment = {**os.environ, "ROS_DOMAIN_ID": "abc", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(JOINING[who], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=100)
    [said] = done.stderr.splitlines()
    assert done.returncode == 1 and not done.stdout and not list(tmp_path.iterdir())
    assert said.split(": ", 1)[1] == "ROS_DOMAIN_ID is 'abc'; a whole number from 0 to 232 is needed"
