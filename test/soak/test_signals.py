# SPDX-License-Identifier: Apache-2.0
"""Told to end: every node while it starts and again while it ends, commands, and who started them; nothing is left."""

import itertools
import os
import pty
import signal
import subprocess
import sys
import time

import psutil
import pytest
from live_demo import BUSY, HAPTIC, ROOT, SCRIPTS, children, demos, end, pages, running
from live_nodes import BESIDE, MODULES, caught, command, loaded
from waiting import exit_code, output, run, until

from haptic_device.process import held

pytestmark = pytest.mark.timeout(900)

NODES = MODULES | BESIDE | {"haptic_viewer": "haptic_display.page.viewer"}
DEMO = len(MODULES) + 1  # nodes of a demo: the recorder too
STARTED = {path.name: [path] for path in SCRIPTS if path.name in NODES}
STARTED |= {"haptic_relay": ["-m", NODES["haptic_relay"]]}
QUIET = ["--ros-args", "-r", "__ns:=/interrupted"]
# A child that makes its standard input the terminal that controls it, and then becomes the command.
ON_TERMINAL = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execvp(sys.argv[1], sys.argv[1:])"
)


@pytest.mark.parametrize("name", STARTED)
def test_a_node_told_to_end_while_it_imports_and_again_and_again_while_it_ends_ends_well(start, name):
    process = start([sys.executable, *STARTED[name], *QUIET], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    until(lambda: loaded(process, "rclpy"), "it has loaded ROS", said=lambda: process.poll())
    numbers = itertools.cycle((signal.SIGINT, signal.SIGTERM, signal.SIGHUP))

    def told():
        process.send_signal(next(numbers))
        time.sleep(0.001)

    until(lambda: process.poll() is not None, f"the end of {name}", told)
    out, said = output(process)
    assert (process.returncode, out) == (0, "") and "Traceback" not in said, said


def test_a_signal_that_comes_before_its_python_runs_waits_for_a_node_that_is_started_so(start):
    with held():
        process = start([sys.executable, "-m", MODULES["haptic_driver"], *QUIET], stderr=subprocess.PIPE)
    process.send_signal(signal.SIGTERM)
    assert output(process)[1] == "" and process.returncode == 0


def test_a_command_that_is_interrupted_while_it_imports_ends_with_130_without_a_word(start, tmp_path):
    [script] = [path for path in SCRIPTS if path.name == "haptic"]
    words = [sys.executable, script, "demo", "--out", tmp_path / "run"]
    process = start(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    until(lambda: signal.SIGTERM in caught(process), "it hears signals")
    process.send_signal(signal.SIGINT)
    assert output(process) == ("", "") and process.returncode == 130
    assert not (tmp_path / "run").exists()


def test_importing_a_node_changes_no_handler_of_whoever_imports_it():
    modules = ", ".join(NODES.values())
    code = f"import signal; was = signal.getsignal(2), signal.getsignal(15); import {modules}\n"
    code += "assert (signal.getsignal(2), signal.getsignal(15)) == was"
    assert run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_recorder_told_to_end_leaves_a_complete_bag(start, tmp_path, number):
    process = start(command("haptic_recorder", bag=str(tmp_path / "bag")), stderr=subprocess.PIPE)
    until(lambda: list(tmp_path.glob("bag/*.mcap")), "the bag")
    process.send_signal(number)
    _, said = output(process)
    assert process.returncode == 0 and "Traceback" not in said
    assert sorted(path.name for path in (tmp_path / "bag").iterdir()) == ["bag_0.mcap", "metadata.yaml"]


_PARENT = """
import sys, time
from pathlib import Path
from haptic_display.run.processes import Nodes, Program
nodes = Nodes(Path(sys.argv[1]))
nodes.start(Program("haptic_recorder", "haptic_device.nodes.recorder", {"bag": sys.argv[2]}))
print(nodes.pid("haptic_recorder"), flush=True)
time.sleep(600)
"""


def test_no_node_outlives_a_parent_that_was_killed(start, tmp_path):
    bag = tmp_path / "bag"
    parent = start([sys.executable, "-c", _PARENT, tmp_path / "log", bag], stdout=subprocess.PIPE)
    child = psutil.Process(int(parent.stdout.readline()))
    until(lambda: list(bag.glob("*.mcap")), "the bag")
    parent.kill()
    exit_code(parent)
    until(lambda: not running([child]), "the end of the node")
    assert (bag / "metadata.yaml").exists()


def ends_well(run, number):
    """Interrupts a demo: no process, no page and no half-written bag are left."""
    nodes = children(run.process)
    run.process.send_signal(number)
    assert run.ended() == 130 and nodes, run.progress
    until(lambda: not running(nodes) and not pages(), "the end of every node", said=lambda: f"{nodes}, {pages()}")
    assert not run.bag.exists() or (run.bag / "metadata.yaml").exists() and f"is {run.bag}" in run.progress
    said = [run.progress, *(log.read_text() for log in (run.out / "log").glob("*.log"))]
    assert not any("Traceback" in text for text in said), said


MOMENTS = {
    "its first node is there": (signal.SIGINT, lambda run: children(run.process)),
    "it loads ROS while its nodes start": (signal.SIGINT, lambda run: loaded(run.process, "rclpy")),
    "its bag is open": (signal.SIGTERM, lambda run: run.bag.exists()),
    "it tells how it goes": (signal.SIGINT, lambda run: "motor" in run.progress),
}


@pytest.mark.parametrize("moment", MOMENTS)
def test_an_interrupt_of_a_demo_leaves_no_process_no_page_and_no_half_written_bag(tmp_path, moment):
    number, come = MOMENTS[moment]
    with demos(tmp_path) as demo:
        run = demo(*BUSY)
        until(lambda: come(run), moment, said=lambda: run.progress)
        ends_well(run, number)


@pytest.mark.parametrize("way", ["terminal closed", "command killed"])
def test_a_closed_terminal_and_a_killed_command_leave_no_process_and_no_page(tmp_path, way):
    out, (control, terminal) = tmp_path / "run", pty.openpty()
    words = [*HAPTIC, "demo", "--scene", "free_space", "--out", str(out), *BUSY]
    own = {"stdin": terminal, "stdout": terminal, "stderr": terminal, "start_new_session": True}
    process = subprocess.Popen([sys.executable, "-c", ON_TERMINAL, *words], cwd=ROOT, **own)
    os.close(terminal)
    try:
        until((out / "bag").exists, "the bag")
        until(lambda: len(children(process)) == DEMO, "the last of the nodes")
        nodes = children(process)
        if way == "command killed":
            process.kill()
        os.close(control)
        control = None
        exit_code(process)
        until(lambda: not running(nodes) and not pages(), "the end of every node", said=lambda: f"{nodes}, {pages()}")
    finally:
        if control is not None:
            os.close(control)
        end(process)
