# SPDX-License-Identifier: Apache-2.0
"""Variables of the environment that ROS would die of, or obey without a word: refused in one sentence."""

import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest
from in_process import haptic
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


SENTENCE = "ROS_DOMAIN_ID is 'abc'; a whole number from 0 to 232 is needed"


@pytest.mark.parametrize(
    "words", [("demo", "--out", "run"), ("record", "--out", "run"), ("status", "--json"), ("mark", "now"), ("view",)]
)
def test_a_command_that_joins_ros_ends_with_that_sentence_and_leaves_nothing(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", "abc")
    done = haptic(*words)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", f"haptic: {SENTENCE}\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("module", ["haptic_device.nodes.recorder", MODULES["haptic_driver"]])
def test_a_node_ends_with_that_sentence_and_leaves_nothing(tmp_path, module):
    environment = {**os.environ, "ROS_DOMAIN_ID": "abc", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", module]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=100)
    assert done.returncode == 1 and not done.stdout and not list(tmp_path.iterdir())
    assert done.stderr.endswith(f": {SENTENCE}\n") and done.stderr.count("\n") == 1
