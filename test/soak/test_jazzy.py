# SPDX-License-Identifier: Apache-2.0
"""test/jazzy.sh where ROS 2 is missing, and with commands that stand for its own."""

import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from waiting import until

ROOT = Path(__file__).resolve().parents[2]
MISSING = 77
USED = ("bash", "cat", "dirname", "env", "grep", "mkdir", "mktemp", "paste", "rm", "sed")
USED += ("sleep", "tail", "timeout", "touch", "tr")
COLCON = """#!/bin/sh
[ "$3" = build ] && mkdir -p install && touch install/local_setup.bash
"""
ROS2 = """#!/bin/sh
case "$* " in
  *--show-args*|*perhaps*|*nowhere*|run\\ haptic_display\\ haptic\\ *) stays=no ;;
  run\\ *|launch\\ *) stays=yes; echo $$ >>"$RUNNING" ;;  # first of all: it may be ended at once
esac
echo "$ROS_DOMAIN_ID $ROS_AUTOMATIC_DISCOVERY_RANGE $*" >>"$SAID_TO"
cat "$ANSWERS"
[ "$stays" = yes ] || exit 0
mkdir -p haptic_bags/one
exec sleep 600
"""
ANSWERS = """peg_in_hole
my_setup.yaml: ok
Argument "record" provided value "perhaps" is not valid.
nowhere is neither a file nor a name
active [3]
unconfigured [1]
Transitioning successful
Double value is: 4000.0
String value is: /share/wall.yaml
String value is: press_wall
success=True
force:
/haptic/trace
greatest force on the hand: 3.00 N
/tf
"""
TOPICS = ("encoder", "handle", "tool", "wrench", "joint_states", "robot_description")
ARGUMENTS = ["namespace", "parameters", "scene", "device", "enable", "loopback", "record", "view", "rviz", "autostart"]
PROGRAMS = ("haptic", "haptic_driver", "haptic_loopback", "haptic_recorder", "haptic_simulation", "haptic_viewer")


@pytest.fixture
def tools(tmp_path):
    """A folder of the commands that the script uses, without those of ROS."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in USED:
        (folder / name).symlink_to(shutil.which(name))
    return folder


@pytest.fixture
def ros(tools, tmp_path):
    """ros(answers) puts a ros2 there that prints these lines whatever it is asked; gives the environment to run in."""

    def commands(answers):
        for name, text in (("ros2", ROS2), ("colcon", COLCON), ("python3", "#!/bin/sh\n")):
            (tools / name).write_text(text)
            (tools / name).chmod(0o755)
        (tmp_path / "answers").write_text(answers)
        (tmp_path / "running").touch()
        return {
            "ROS_DISTRO": "jazzy",
            "SAID_TO": str(tmp_path / "said"),
            "ANSWERS": str(tmp_path / "answers"),
            "RUNNING": str(tmp_path / "running"),
            "JAZZY_PATIENCE": "1",
        }

    return commands


def jazzy(tools, folder, **environment):
    environment = {"PATH": str(tools), "HOME": str(folder), "TMPDIR": str(folder)} | environment
    return subprocess.run([str(ROOT / "test/jazzy.sh")], env=environment, capture_output=True, text=True)


def started(tmp_path):
    """Process ids of the nodes and launches that were started."""
    return [int(line) for line in (tmp_path / "running").read_text().split()]


def is_running(pid):
    return os.path.exists(f"/proc/{pid}")


def test_without_ros_it_names_what_is_missing_and_has_an_exit_code_of_its_own(tools, tmp_path):
    done = jazzy(tools, tmp_path)
    assert done.returncode == MISSING
    (sentence,) = done.stderr.splitlines()
    assert sentence.startswith("jazzy: missing here: ros2 colcon python3 ROS_DISTRO=jazzy (")
    assert done.stdout == "" and not list(tmp_path.glob("haptic_jazzy.*"))


def test_a_python_module_that_is_missing_is_named_alone(tools, tmp_path, ros):
    environment = ros("")
    (tools / "python3").write_text('#!/bin/sh\ncase "$*" in *"import fcl"*) exit 1 ;; esac\n')
    done = jazzy(tools, tmp_path, **environment)
    assert done.returncode == MISSING
    assert "missing here: python3-module:fcl (" in done.stderr


def every_answer():
    lines = [f"/haptic/{topic}" for topic in TOPICS] + [f"    '{name}':" for name in ARGUMENTS]
    return ANSWERS + "\n".join([*lines, *(f"haptic_display {name}" for name in PROGRAMS)]) + "\n"


def test_it_says_so_when_all_is_well_and_leaves_nothing_behind(tools, tmp_path, ros):
    done = jazzy(tools, tmp_path, **ros(every_answer()))
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "jazzy: all is as the documents say"
    pids = started(tmp_path)
    assert len(pids) == 8, "a launch, three nodes, two launches by other hands, two examples"
    assert not any(map(is_running, pids)) and not list(tmp_path.glob("haptic_jazzy.*"))
    said = [line.split() for line in (tmp_path / "said").read_text().splitlines()]
    assert len({line[0] for line in said}) == 1 and {line[1] for line in said} == {"LOCALHOST"}
    graph = [line for line in said if line[2] in ("topic", "param", "lifecycle", "node")]
    assert graph and all("--no-daemon" in line for line in graph)


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        ("success=True", "the driver can be enabled: not so"),
        ("/haptic/joint_states", "/haptic/joint_states is there: not so"),
        ("peg_in_hole", "haptic runs by ros2 run: not so"),
    ],
)
def test_one_sentence_names_what_was_not_so_and_what_it_started_has_ended(tools, tmp_path, ros, answer, sentence):
    done = jazzy(tools, tmp_path, **ros(every_answer().replace(answer, "")))
    assert done.returncode == 1
    (said,) = done.stderr.splitlines()
    assert said.startswith(f"jazzy: {sentence}") and "logs are in" in said
    assert not any(map(is_running, started(tmp_path)))


def test_interrupted_it_ends_what_it_started(tools, tmp_path, ros):
    environment = ros(every_answer().replace("active [3]", "")) | {"JAZZY_PATIENCE": "600"}
    script = subprocess.Popen(
        [str(ROOT / "test/jazzy.sh")],
        env={"PATH": str(tools), "HOME": str(tmp_path), "TMPDIR": str(tmp_path)} | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    until(lambda: started(tmp_path), "a node")
    time.sleep(0.2)  # into the loop that asks
    script.terminate()
    assert script.wait(60) == 130
    assert not any(map(is_running, started(tmp_path)))
