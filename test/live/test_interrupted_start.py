# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while a node or a command still loads its modules: it ends at once, and has nothing to say."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from live_demo import HAPTIC, SCRIPTS
from live_nodes import BESIDE, MODULES, caught, loaded
from waiting import output, run, until

from haptic_device.process import held

pytestmark = pytest.mark.timeout(600)

NODES = MODULES | BESIDE | {"haptic_viewer": "haptic_sim.viewer.viewer"}
WAYS = [(sys.executable, "-m", module) for module in NODES.values()]
WAYS += [(sys.executable, path) for path in SCRIPTS if path.name != "haptic"]
QUIET = ["--ros-args", "-r", "__ns:=/interrupted"]
MOMENTS = {
    "it hears signals": lambda process: signal.SIGTERM in caught(process),
    "it has loaded ROS": lambda process: loaded(process, "rclpy"),
}


def interrupted(process, number=signal.SIGINT):
    """(exit code, what it printed) of a process that is signalled now."""
    process.send_signal(number)
    return output(process), process.returncode


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("way", WAYS, ids=lambda way: Path(way[-1]).name)
def test_a_node_that_is_interrupted_while_it_imports_ends_well_without_a_word(start, way, moment):
    process = start([*way, *QUIET], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    until(lambda: MOMENTS[moment](process), moment, said=lambda: process.poll())
    (out, said), code = interrupted(process)
    assert (code, out) == (0, "") and "Traceback" not in said, said


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_comes_before_its_python_runs_waits_for_a_node_that_is_started_so(start, number):
    with held():
        process = start([sys.executable, "-m", MODULES["haptic_driver"], *QUIET], stderr=subprocess.PIPE)
    assert interrupted(process, number) == ((None, ""), 0)


@pytest.mark.parametrize("how", ["as a module", "as a script"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_that_is_interrupted_while_it_imports_ends_with_130_without_a_word(start, tmp_path, number, how):
    command = HAPTIC if how == "as a module" else [sys.executable, *(path for path in SCRIPTS if path.name == "haptic")]
    process = start([*command, "demo", "--out", tmp_path / "run"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    until(lambda: signal.SIGTERM in caught(process), "it hears signals")
    assert interrupted(process, number) == (("", ""), 130)
    assert not (tmp_path / "run").exists()


def test_importing_a_node_changes_no_handler_of_whoever_imports_it():
    modules = ", ".join(NODES.values())
    code = f"import signal; was = signal.getsignal(2), signal.getsignal(15); import {modules}\n"
    code += "assert (signal.getsignal(2), signal.getsignal(15)) == was"
    assert run([sys.executable, "-c", code]).returncode == 0
