# SPDX-License-Identifier: Apache-2.0
"""What the operating system or ROS refuses, would die of or obey without a word: one sentence, which and why."""

import errno
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest
from in_process import haptic

from haptic_device import process, ros_environment
from haptic_device.nodes.lifecycle import begin_ros
from haptic_device.os_errors import in_words, naming


def refusal(called, *given):
    with pytest.raises(ValueError) as refused:
        called(*given)
    return str(refused.value)


def test_a_domain_is_what_ros_takes_it_for_and_one_that_ros_reads_otherwise_is_refused(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert ros_environment.domain() == 0
    for given, domain in (("", 0), ("0", 0), ("7", 7), ("232", 232)):
        monkeypatch.setenv("ROS_DOMAIN_ID", given)
        assert ros_environment.domain() == domain
    for given in ("-1", "abc", "233", "1.0", "0x10", "010", " 7", "99999999999999999999", "٣"):
        monkeypatch.setenv("ROS_DOMAIN_ID", given)
        said = f"ROS_DOMAIN_ID is {given!r}; a whole number from 0 to 232 is needed"
        assert refusal(ros_environment.check) == said


def test_ros_without_a_folder_for_its_log_is_refused(monkeypatch, tmp_path):
    for name in ("ROS_LOG_DIR", "ROS_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    said = "HOME is not set, below which ROS keeps its log; set it, or ROS_LOG_DIR"
    assert refusal(ros_environment.check) == said
    (tmp_path / "file").touch()
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "file"))
    assert "file/log, which cannot be made (Not a directory); let ROS_LOG_DIR name" in refusal(ros_environment.check)
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


def test_a_command_that_joins_ros_ends_with_that_sentence_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", "abc")
    for words in ("demo --out run", "record --out run", "status --json", "mark now", "view"):
        done = haptic(*words.split())
        assert (done.returncode, done.stdout, done.stderr) == (1, "", f"haptic: {SENTENCE}\n")
    assert not list(tmp_path.iterdir())


def test_a_node_ends_with_that_sentence_and_leaves_nothing(tmp_path):
    environment = {**os.environ, "ROS_DOMAIN_ID": "abc", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", "haptic_device.nodes.recorder"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=100)
    assert done.returncode == 1 and not done.stdout and not list(tmp_path.iterdir())
    assert done.stderr.endswith(f": {SENTENCE}\n") and done.stderr.count("\n") == 1


def test_an_error_is_said_on_one_line_without_its_number_and_only_what_has_no_name_is_given_one():
    for error, words in (
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (OSError(errno.EACCES, "Permission denied", "a.yaml"), "a.yaml: Permission denied"),
        (OSError(errno.EXDEV, "Invalid cross-device link", "a", None, "b"), "a: b: Invalid cross-device link"),
        (ValueError("two\n lines"), "two lines"),
    ):
        assert in_words(error) == words
    with pytest.raises(OSError) as refused, naming("b"):
        raise OSError(errno.EACCES, "Permission denied", "a")
    assert refused.value.filename == "a"
    with pytest.raises(OSError, match="^a sentence$"), naming("b"):
        raise OSError("a sentence")


def test_an_argument_that_ros_cannot_read_is_refused_with_what_to_write():
    write, rename = "write -p NAME:=VALUE, the value as in YAML: 1.0, true, text or [1.0, 2.0]", "write -r FROM:=TO"
    for flag, word, cure in (
        ("-p", "bad:=[", write),
        ("-p", "bad", write),
        ("-p", ":=1", write),
        ("-r", "a:b=", rename),
    ):
        said = refusal(begin_ros, ["--ros-args", flag, word])
        assert said == f"ROS does not take these arguments: {flag} {word}: {cure}"


def test_a_parameter_file_that_ros_cannot_read_is_refused_with_its_name_and_line(tmp_path):
    path = tmp_path / "point.yaml"
    arguments = ["--ros-args", "--params-file", str(path)]
    assert refusal(begin_ros, arguments) == f"{path}: No such file or directory"
    for text, sentence in (
        ("a: [\n", "line 2 is not YAML: "),
        ("/**: {ros__parameters: {a: &r 1, b: *r}}\n", "line 1 is not YAML: ROS 2 parameter files have no aliases"),
        ("/**: {ros__parameters: {a: 1, a: 2}}", "a is written twice, the second time in line 1"),
        ("/**: {ros__parameters: {a: 1}}\nx", "line 3 is not YAML: "),
    ):
        path.write_text(text)
        assert refusal(begin_ros, arguments).startswith(f"{path}: {sentence}")
