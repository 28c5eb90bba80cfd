# SPDX-License-Identifier: Apache-2.0
"""The command's hold on its child processes; no ROS needed."""

import asyncio
import os
import signal
import sys

import psutil
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from waiting import LIMIT, until

from haptic_device.config.files import find
from haptic_display.page import node_manager
from haptic_display.page.node_manager import NodeManager
from haptic_display.run import processes
from haptic_display.run.domain import isolated_domain
from haptic_display.run.processes import NodeDiedError, Nodes, Program, interruptible, parameter_text
from haptic_display.run.system import Order, programs_of

pytestmark = pytest.mark.timeout(900)

_STUBBORN = """
import signal, time
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, signal.SIG_IGN)
print("deaf", flush=True)
time.sleep(600)
"""
# Interrupts who started it when it is asked to end, and ends only then.
_TELLS = f"""
import os, signal, sys, time
def tell(number, frame):
    os.kill({os.getpid()}, signal.SIGINT)
    sys.exit()
signal.signal(signal.SIGINT, tell)
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
print("ready", flush=True)
time.sleep(600)
"""
_PATIENT = """
import signal, time
signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
print("ready", flush=True)
time.sleep(600)
"""
_FALLS = "print('all is well')\nraise RuntimeError('the motor is gone')\n"
_KILLED = """
import os
print("[ERROR] [1.0] [x]: first", "[ERROR] [2.0] [x]: second", "[INFO] [3.0] [x]: engaged", sep=os.linesep, flush=True)
os.kill(os.getpid(), 9)
"""


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Makes a program of a few lines of Python that takes the place of a node."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)

    def make(name: str, text: str) -> Program:
        (tmp_path / f"{name}.py").write_text(text)
        return Program(name, name)

    return make


def wait_for_line(nodes: Nodes, name: str, line: str) -> None:
    until(lambda: nodes.last_line(name) == line, f"{line!r} of {name}")


@given(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="ascii", exclude_categories=["Cc"]))
    | st.lists(st.floats(-1e9, 1e9), min_size=1)
)
def test_a_parameter_on_the_command_line_is_read_back_as_the_same_value(value):
    read = yaml.safe_load(parameter_text(value))
    assert (float(read) if isinstance(value, float) else read) == value or [float(item) for item in read] == value


def test_two_systems_get_two_domains_on_the_loopback_interface_and_one_that_is_given_is_kept(tmp_path, monkeypatch):
    names = "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"
    for name in names:
        monkeypatch.delenv(name, raising=False)
    with isolated_domain(tmp_path) as first:
        assert [os.environ[name] for name in names] == [str(first), "LOCALHOST"]
        with isolated_domain(tmp_path) as given:
            assert given == first
        monkeypatch.delenv("ROS_DOMAIN_ID")
        with isolated_domain(tmp_path) as second:
            assert first != second
        monkeypatch.setenv("ROS_DOMAIN_ID", str(first))


def test_a_node_that_has_ended_is_told_with_its_exit_code_or_signal_and_its_last_error_and_was_not_deaf(
    tmp_path, program, capsys
):
    told = {
        "falling_node": "falling_node ended with exit code 1: RuntimeError: the motor is gone",
        "killed_node": "killed_node was ended by SIGKILL (signal 9): [ERROR] [2.0] [x]: second",
    }
    with Nodes(tmp_path / "log") as nodes:
        for name, text in zip(told, (_FALLS, _KILLED), strict=True):
            nodes.start(program(name, text))
        until(lambda: nodes.ended().keys() == told.keys(), "the end of the nodes")
        assert nodes.ended() == told
        with pytest.raises(NodeDiedError, match="falling_node ended"):
            nodes.check()
    assert capsys.readouterr().err == ""


def test_a_node_that_stands_still_is_killed_and_started_again_and_the_others_go_on(tmp_path, program, monkeypatch):
    stopped, other = program("stopped_node", _PATIENT), program("other_node", _PATIENT)
    monkeypatch.setattr(node_manager, "programs_of", lambda order: [stopped, other])
    order = Order("wall", None, tmp_path, None, None, tmp_path)
    with Nodes(tmp_path / "log") as nodes:
        manager = NodeManager(order, nodes)
        manager.start()
        before = {name: nodes.pid(name) for name in ("stopped_node", "other_node")}
        for name in before:
            wait_for_line(nodes, name, "ready")
        os.kill(before["stopped_node"], signal.SIGSTOP)
        asyncio.run(manager.start_again(["stopped_node"]))
        assert not psutil.pid_exists(before["stopped_node"]) and not manager.changing and manager.ended() == {}
        assert nodes.pid("other_node") == before["other_node"] != nodes.pid("stopped_node")


def test_a_deaf_node_is_killed_and_that_is_said(tmp_path, program, monkeypatch, capsys):
    quick = ((signal.SIGINT, 0.1), (signal.SIGTERM, 0.1), (signal.SIGKILL, LIMIT))
    monkeypatch.setattr(processes, "_PATIENCE", quick)
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(program("deaf_node", _STUBBORN))
        wait_for_line(nodes, "deaf_node", "deaf")
        pid = nodes.pid("deaf_node")
    assert not psutil.pid_exists(pid) and "deaf_node had to be killed" in capsys.readouterr().err


def test_an_interrupt_while_nodes_end_waits_until_all_have_ended(tmp_path, program, monkeypatch):
    monkeypatch.setattr(processes, "_PATIENCE", ((signal.SIGINT, LIMIT), (signal.SIGKILL, LIMIT)))
    nodes, pids = Nodes(tmp_path / "log"), []
    with pytest.raises(KeyboardInterrupt), interruptible(), nodes:
        for name, text in {"first_node": _PATIENT, "last_node": _TELLS}.items():  # the last is asked to end first
            nodes.start(program(name, text))
            wait_for_line(nodes, name, "ready")
            pids.append(nodes.pid(name))
    assert len(pids) == 2 and not any(psutil.pid_exists(pid) for pid in pids)
    assert nodes.last_line("first_node") == "KeyboardInterrupt"  # it ended by what it was asked, as if nothing had come


def test_a_node_that_is_told_to_end_before_its_python_runs_hears_it_as_soon_as_it_listens(tmp_path, program):
    hearing = "from haptic_device.process import hear\nhear(lambda number, frame: print('told', number, flush=True))\n"
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(program("told_node", f"{hearing}import time\ntime.sleep(600)\n"))
        os.kill(nodes.pid("told_node"), signal.SIGTERM)
        wait_for_line(nodes, "told_node", "told 15")
        os.kill(nodes.pid("told_node"), signal.SIGKILL)


LED = [
    (0.009, "desktop", "press_wall", False),
    (0.01, "desktop", "press_wall", True),
    (0.009, "own_device", "press_wall", True),  # whose hand is a person's
    (0.009, "desktop", "follow", True),  # whose hand a page leads out
]


def test_nodes_are_handed_the_files_that_an_operating_point_names_beside_itself(tmp_path):
    (tmp_path / "mine.yaml").write_text(find("devices", "desktop").read_text())
    (tmp_path / "point.yaml").write_text("/**/haptic_driver: {ros__parameters: {device: ./mine.yaml}}\n")
    order = Order("wall", None, tmp_path / "out", None, None, tmp_path / "point.yaml")
    given = {program.name: program.parameters for program in programs_of(order)}
    for name in ("haptic_driver", "haptic_loopback"):
        assert given[name]["device"] == str(tmp_path / "mine.yaml")


@pytest.mark.parametrize(("x", "device", "name", "taken"), LED)
def test_a_simulated_hand_that_starts_inside_a_body_is_refused_and_no_other(tmp_path, x, device, name, taken):
    scene = tmp_path / "led.yaml"
    scene.write_text(find("scenes", "wall").read_text().replace("start: [0.03, 0.0, 0.0]", f"start: [{x}, 0, 0]"))
    hand = {"haptic_loopback": {"motion.name": name}}
    order = Order(str(scene), 2.0, tmp_path / "out", None, None, find("", "demo"), given=hand, device=device)
    if taken:
        assert programs_of(order)
        return
    with pytest.raises(ValueError, match=r"led.yaml: motion.start is \[.*: bodies\[0\] \('wall'\) overlaps .* by 1 mm"):
        programs_of(order)


def test_the_command_line_is_quick_to_load():
    heavy = "{'rclpy', 'matplotlib', 'numba', 'pymunk', 'rosbags'}"
    code = f"import sys, haptic_display.cli.demo, haptic_display.cli.record\nsys.exit(bool({heavy} & set(sys.modules)))"
    assert os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-c", code]) == 0
