# SPDX-License-Identifier: Apache-2.0
"""What the operating system or ROS refuses is said in one sentence: which file or argument, and why."""

import errno

import pytest
from in_process import haptic

from haptic_device.nodes.lifecycle import begin_ros
from haptic_device.os_errors import in_words, naming

PASSIVITY = ("passivity", "--stiffness", "1e3", "--damping", "1", "--physical-damping", "3", "--period", "1e-3")
FULL, NOWHERE = ("/dev/full", "No space left on device"), ("/nowhere/file", "No such file or directory")


@pytest.mark.parametrize(("file", "reason"), [FULL, NOWHERE])
@pytest.mark.parametrize("words", [("docs", "--out"), (*PASSIVITY, "--plot"), ("scenes", "--draw", "wall", "--out")])
def test_a_file_that_takes_nothing_is_named_with_the_reason(words, file, reason):
    done = haptic(*words, file)
    name = "haptic passivity" if words[0] == "passivity" else "haptic"
    assert done.returncode != 0 and done.stderr == f"{name}: {file}: {reason}\n"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (OSError(errno.EACCES, "Permission denied", "a.yaml"), "a.yaml: Permission denied"),
        (OSError(errno.EXDEV, "Invalid cross-device link", "a", None, "b"), "a: b: Invalid cross-device link"),
        (FileNotFoundError("no such\nname"), "no such name"),
        (ValueError("two\n lines"), "two lines"),
    ],
)
def test_an_error_is_said_on_one_line_without_its_number(error, words):
    assert in_words(error) == words


def test_a_name_is_given_only_to_what_has_none():
    with pytest.raises(OSError) as refused, naming("b"):
        raise OSError(errno.EACCES, "Permission denied", "a")
    assert refused.value.filename == "a"
    with pytest.raises(OSError, match="^a sentence$"), naming("b"):
        raise OSError("a sentence")


WRITE, RENAME = "write -p NAME:=VALUE, the value as in YAML: 1.0, true, text or [1.0, 2.0]", "write -r FROM:=TO"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("-p", "bad:=["), f"-p bad:=[: {WRITE}"),
        (("-p", "bad"), f"-p bad: {WRITE}"),
        (("-p", ":=1"), f"-p :=1: {WRITE}"),
        (("-r", "a:b="), f"-r a:b=: {RENAME}"),
    ],
)
def test_an_argument_that_ros_cannot_read_is_refused_with_what_to_write(words, sentence):
    with pytest.raises(ValueError) as refused:
        begin_ros(["--ros-args", *words])
    assert str(refused.value) == f"ROS does not take these arguments: {sentence}"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a: [\n", "line 2 is not YAML: "),
        ("/**: {ros__parameters: {a: &r 1, b: *r}}\n", "line 1 is not YAML: ROS 2 parameter files have no aliases"),
        ("/**: {ros__parameters: {a: 1, a: 2}}", "a is written twice, the second time in line 1"),
        ("/**: {ros__parameters: {a: 1}}\nx", "line 3 is not YAML: "),
    ],
)
def test_a_parameter_file_that_ros_cannot_read_is_refused_with_its_line(tmp_path, text, sentence):
    path = tmp_path / "point.yaml"
    path.write_text(text)
    with pytest.raises(ValueError) as refused:
        begin_ros(["--ros-args", "--params-file", str(path)])
    assert str(refused.value).startswith(f"{path}: {sentence}")


def test_a_parameter_file_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="^/nowhere.yaml: No such file or directory$"):
        begin_ros(["--ros-args", "--params-file", "/nowhere.yaml"])
