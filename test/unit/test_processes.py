# SPDX-License-Identifier: Apache-2.0
"""The command's hold on its child processes, and its verdict on a run; no ROS needed."""

import asyncio
import os
import shutil
import signal
import sys

import psutil
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from waiting import LIMIT, until

from haptic_device.config_files import find
from haptic_device.control.faults import TABLE
from haptic_sim.outcome import ANSWERED, GOALS, REACHED, not_done, nothing
from haptic_sim.supervision import node_manager, processes
from haptic_sim.supervision.domain import isolated_domain
from haptic_sim.supervision.node_manager import NodeManager
from haptic_sim.supervision.processes import NodeDiedError, Nodes, Program, interruptible, parameter_text
from haptic_sim.supervision.system import Order, programs_of

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
    assert (float(read) if isinstance(value, float) else read) == value or _as_floats(read) == value


def _as_floats(read):
    return [float(item) for item in read]


def test_a_list_with_one_decimal_number_is_all_decimal_numbers():
    assert parameter_text([0, 0.5, 1]) == "[0.0, 0.5, 1.0]" and parameter_text(["y"]) == "['y']"


def test_two_systems_get_two_domains_on_the_loopback_interface(tmp_path, monkeypatch):
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.delenv(name, raising=False)
    with isolated_domain(tmp_path) as first:
        assert os.environ["ROS_DOMAIN_ID"] == str(first)
        assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
        monkeypatch.delenv("ROS_DOMAIN_ID")
        with isolated_domain(tmp_path) as second:
            assert first != second
        monkeypatch.setenv("ROS_DOMAIN_ID", str(first))
    assert "ROS_DOMAIN_ID" not in os.environ and "ROS_AUTOMATIC_DISCOVERY_RANGE" not in os.environ


def test_a_domain_that_is_given_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "57")
    with isolated_domain(tmp_path) as domain:
        assert domain == 57
    assert os.environ["ROS_DOMAIN_ID"] == "57"


def test_a_node_that_dies_is_named_with_its_last_error(tmp_path, program):
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(program("falling_node", _FALLS))
        wait_for_line(nodes, "falling_node", "RuntimeError: the motor is gone")
        fallen = psutil.Process(nodes.pid("falling_node"))
        until(lambda: fallen.status() == psutil.STATUS_ZOMBIE, "the end of the node")
        with pytest.raises(NodeDiedError, match="falling_node ended with exit code 1: RuntimeError: the motor is gone"):
            nodes.check()


def test_a_node_that_refuses_is_named_once(tmp_path, program):
    refuses = "import sys\nprint('refusing_node: the gains are not passive', file=sys.stderr)\nsys.exit(1)\n"
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(program("refusing_node", refuses))
        until(nodes.ended, "the end of the node")
        said = "refusing_node ended with exit code 1: the gains are not passive"
        assert nodes.ended() == {"refusing_node": said}


@pytest.mark.parametrize(("seen", "said"), [(True, ": RuntimeError: the motor is gone"), (False, "")])
def test_how_a_node_ended_is_known_also_when_its_log_has_gone(tmp_path, program, seen, said):
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(program("falling_node", _FALLS))
        fallen = psutil.Process(nodes.pid("falling_node"))
        until(lambda: fallen.status() == psutil.STATUS_ZOMBIE, "the end of the node")
        if seen:
            nodes.ended()
        shutil.rmtree(tmp_path / "log")
        assert nodes.ended() == {"falling_node": f"falling_node ended with exit code 1{said}"}


@pytest.mark.parametrize(
    ("printed", "said"),
    [
        (["[INFO] [1.0] [x]: servo at 4000 Hz"], ""),
        (["[ERROR] [1.0] [x]: fault velocity", "[INFO] [2.0] [x]: engaged"], ": [ERROR] [1.0] [x]: fault velocity"),
        (["[ERROR] [1.0] [x]: first", "[ERROR] [2.0] [x]: second"], ": [ERROR] [2.0] [x]: second"),
    ],
)
def test_a_node_that_somebody_killed_is_told_with_the_signal_and_its_last_error_and_was_not_deaf(
    tmp_path, program, capsys, printed, said
):
    text = "".join(f"print({line!r})\n" for line in printed) + _PATIENT
    with Nodes(tmp_path / "log") as nodes:
        nodes.start(program("killed_node", text))
        wait_for_line(nodes, "killed_node", "ready")
        assert nodes.ended() == {}
        os.kill(nodes.pid("killed_node"), signal.SIGKILL)
        until(nodes.ended, "the end of the node")
        assert nodes.ended() == {"killed_node": f"killed_node was ended by SIGKILL (signal 9){said}"}
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
        for name, text in (
            ("first_node", _PATIENT),
            ("last_node", _TELLS),
        ):  # the last is asked to end before the first
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


def test_nodes_are_handed_the_files_that_an_operating_point_names_beside_itself(tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text(find("devices", "desktop").read_text())
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    point = tmp_path / "point.yaml"
    point.write_text(
        "/**/haptic_driver: {ros__parameters: {device: mine.yaml}}\n"
        "/**/haptic_loopback: {ros__parameters: {device: ./mine.yaml}}\n"
    )
    order = Order("wall", None, tmp_path / "out", None, None, point)
    given = {program.name: program.parameters for program in programs_of(order)}
    assert given["haptic_driver"]["device"] == given["haptic_loopback"]["device"] == str(tmp_path / "mine.yaml")
    assert given["haptic_simulation"]["scene"] == str(
        find("scenes", "wall").absolute()
    )  # the command's, not the file's
    point.write_text("/**/haptic_driver: {ros__parameters: {device: undamped}}\n")
    given = {program.name: program.parameters for program in programs_of(order)}
    assert given["haptic_driver"]["device"] == given["haptic_loopback"]["device"] == "undamped"


def outcome(faults=(), result=None, sent=1000, answered=1000) -> dict:
    exchange = {"sent": sent, "answered": answered}
    return {**nothing(), "faults": list(faults), "result": result or {}, "exchange": exchange}


@pytest.mark.parametrize("goal", GOALS)
def test_a_goal_is_reached_just_above_the_bound_and_not_just_below_which_is_said(goal):
    stood = "the motion did not end, and no news for 90 s"
    assert not_done(outcome(result={goal: REACHED}, answered=1)) == ""
    assert not_done(outcome(result={goal: REACHED}), stood) == ""
    short = f"{goal} came to 0.94, and {REACHED:g} is the least"
    assert not_done(outcome(result={goal: 0.94})) == short
    assert not_done(outcome(result={goal: 0.94}), stood) == f"{stood}; {short}"
    assert not_done(outcome(result={goal: REACHED - 1e-9}))


def test_every_goal_that_was_missed_is_said():
    missed = [f"{goal} came to 0, and {REACHED:g} is the least" for goal in GOALS]
    assert not_done(outcome(result=dict.fromkeys(GOALS, 0.0))) == "; ".join(missed)


def test_another_scene_is_done_if_it_ended_and_was_answered_and_what_it_lacks_is_said():
    just = int(ANSWERED * 1000)
    lack = f"{just - 1} of 1000 handle samples were answered, and {just} are the least"
    assert not_done(outcome(answered=just)) == "" and not_done(outcome(answered=just - 1)) == lack
    assert not_done(outcome(), "the motion did not end") == "the motion did not end"


def test_behind_a_relay_one_answer_is_enough_and_none_is_said():
    none = "0 of 1000 handle samples were answered, and 1 are the least"
    assert not_done(outcome(answered=1), share=0.0) == "" and not_done(outcome(answered=0), share=0.0) == none
    assert not_done(outcome(sent=0, answered=0)) == "0 of 0 handle samples were answered, and 1 are the least"


@pytest.mark.parametrize("entry", TABLE, ids=lambda entry: entry.name)
def test_nothing_is_done_with_a_fault_whose_cause_and_next_step_are_said(entry):
    said = not_done(outcome(faults=[entry.name], result={"insertion_fraction": 1.0}))
    assert said.startswith(f"{entry.title} (fault {entry.name}): {entry.cause}. ")
    assert said.lower().endswith(f"{entry.first.lower()}{', then ' if entry.first else ''}start again.")
    unended = f"the motion did not end: {said}"
    assert not_done(outcome(faults=[entry.name]), unended) == unended


def test_nothing_is_done_without_figures_and_what_went_wrong_is_said():
    assert not_done(nothing()) == "the run left no figures"
    died = "haptic_simulation was ended by SIGKILL (signal 9)"
    assert not_done(nothing() | {"faults": [died]}) == died


def test_the_command_line_is_quick_to_load():
    heavy = "{'rclpy', 'matplotlib', 'numba', 'pymunk', 'rosbags'}"
    code = f"import sys, haptic_sim.cli.demo, haptic_sim.cli.record\nsys.exit(bool({heavy} & set(sys.modules)))"
    assert os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-c", code]) == 0
