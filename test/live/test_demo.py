# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` alive: the job is done, and no way of ending it leaves anything behind."""

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from live_demo import BUSY, HAPTIC, ROOT, children, demos, end, ends_well, pages, running, until
from live_nodes import strange_diagnostics
from waiting import LIMIT, exit_code

from haptic_device.control import withheld
from haptic_device.recording import load
from haptic_sim.cli import main
from haptic_sim.client import Client
from haptic_sim.reduction import reduce_scene
from haptic_sim.replay.trace_verification import verdict_on
from haptic_sim.scene import language
from haptic_sim.service_requests import trigger
from haptic_sim.supervision.processes import NAMESPACE

pytestmark = pytest.mark.timeout(900)

NODES = ("haptic_driver", "haptic_loopback", "haptic_recorder", "haptic_simulation")
# A child that makes its standard input the terminal that controls it, and then becomes the command.
ON_TERMINAL = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execvp(sys.argv[1], sys.argv[1:])"
)


@pytest.fixture
def demo(tmp_path):
    """demo(*options) starts it; whatever the test came to, it and its nodes have ended afterwards."""
    with demos(tmp_path) as start:
        yield start


def flat(found: dict, prefix: str = "") -> set[str]:
    keys = set()
    for key, value in found.items():
        keys |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key}
    return keys


def documented() -> set[str]:
    text = (ROOT / "docs" / "cli.md").read_text().split("| key |")[1]
    return set(re.findall(r"^\| `([\w.]+)` \|", text, re.MULTILINE))


def test_the_peg_goes_into_the_hole_every_figure_is_reported_and_no_node_compiles(demo, monkeypatch):
    monkeypatch.setenv("NUMBA_DEBUG_CACHE", "1")  # numba says what it loads, and what it had to compile
    run = demo("--json", *BUSY)
    assert run.ended() == 0, run.progress + run.said
    logs = {log.stem: log.read_text() for log in (run.out / "log").glob("haptic_*.log")}
    assert all("data loaded from" in logs[name] for name in ("haptic_driver", "haptic_loopback", "haptic_simulation"))
    assert not any("data saved to" in log for log in logs.values())
    found = json.loads(run.said.splitlines()[-1])
    assert found["done"] and found["faults"] == [] and found["result"]["insertion_fraction"] >= 0.95
    # by cause, and what is withheld on a busy machine is not known
    causes = {f"withheld_s.{cause.name}" for cause in withheld.TABLE}
    assert flat(found) - causes == documented() - {"withheld_s.CAUSE"} and isinstance(found["withheld_s"], dict)
    assert found["simulation"].pop("waited_s") >= 0.0  # what a busy machine leaves out is not known
    assert found["simulation"] == {"method": "impulse", "why": reduce_scene(language.load("peg_in_hole")).reasons[0]}
    assert found["exchange"]["sent"] >= found["exchange"]["answered"] > 0
    assert found["energy_j"]["given_to_operator_end"] < 0.0  # by the truth: who pushed the peg has worked
    assert found["contact"]["max_force_n"] > 0.0
    assert Path(found["report"]).read_bytes().startswith(b"\x89PNG")
    recording = load(Path(found["bag"]))
    assert {"trial.yaml", "made.yaml", "device/desktop.yaml", "scene/peg_in_hole.yaml"} <= set(recording.attachments)
    rise = {"encoder", "motor", "handle", "tool", "wrench", "pose", "joint_states", "operator/state", "trace"}
    rise |= {"snapshot", "scene/state", "scene/contacts"}
    assert set(recording.orders) == {f"/haptic/{topic}" for topic in rise}
    assert all((order.back, order.same) == (0, 0) for order in recording.orders.values())
    every = verdict_on(recording.trace, recording.clouds["snapshot"])
    assert every.different == 0 and every.same > 0 and every.same + every.skipped == len(recording.trace)
    later = verdict_on(recording.trace[100:], recording.clouds["snapshot"])
    assert later.different == 0 and later.same > 0  # from memory that was copied while the servo ran


def test_strange_diagnostics_neither_end_a_demo_nor_spoil_its_figures(demo):
    with strange_diagnostics():
        # Long enough for a machine that stands still for some tenths of a second: a tenth unanswered is not done.
        run = demo("--json", "--seconds", "4.0", *BUSY, scene="free_space")
        assert run.ended() == 0, run.progress + run.said
    found = json.loads(run.said.splitlines()[-1])
    assert found["done"] and found["faults"] == [] and "Traceback" not in run.progress


def test_an_interrupt_leaves_no_process_no_page_and_no_half_written_bag(demo):
    run = demo(*BUSY)
    until(lambda: "motor" in run.progress, "it tells how it goes", said=lambda: run.progress)
    ends_well(run, signal.SIGINT)


@pytest.mark.parametrize("way", ["terminal closed", "command killed"])
def test_a_closed_terminal_and_a_killed_command_leave_no_process_and_no_page(tmp_path, way):
    out, (control, terminal) = tmp_path / "run", pty.openpty()
    command = [*HAPTIC, "demo", "--scene", "free_space", "--out", str(out), *BUSY]
    own = {"stdin": terminal, "stdout": terminal, "stderr": terminal, "start_new_session": True}
    process = subprocess.Popen([sys.executable, "-c", ON_TERMINAL, *command], cwd=ROOT, **own)
    os.close(terminal)
    try:
        until((out / "bag").exists, "the bag")
        until(lambda: len(children(process)) == len(NODES), "the last of the nodes")
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


def test_a_dead_node_ends_the_demo_and_is_named(demo):
    run = demo("--json", *BUSY)
    until(run.bag.exists, "the bag", said=lambda: run.progress)
    until(lambda: len(children(run.process)) == len(NODES), "the last of the nodes", said=lambda: run.progress)
    nodes = children(run.process)
    node_of(run, "haptic_sim.node.simulation").kill()
    assert run.ended() == 1 and "haptic_simulation ended with exit code -9" in run.progress
    assert not json.loads(run.said)["done"] and (run.bag / "metadata.yaml").exists()
    assert not running(nodes) and not pages()


def test_a_demo_whose_device_falls_silent_before_the_motion_begins_anew_and_does_its_job(demo, ros_domain):
    run = demo("--json", *BUSY, scene="free_space")
    simulation = until(lambda: node_of(run, "haptic_sim.node.simulation"), "the simulation")
    simulation.suspend()  # the driver does not engage without it
    loopback = node_of(run, "haptic_device.nodes.loopback")
    with contextlib.closing(Client.join("stalls", ros_domain, NAMESPACE)) as client:

        def says(name, wanted):
            client.look()
            return wanted(client.said("haptic_driver", name))

        until(lambda: says("ticks", lambda ticks: int(ticks or 0) > 0), "the servo runs", said=lambda: run.progress)
        loopback.suspend()
        until(lambda: says("fault", lambda fault: fault == "device_silent"), "the fault", said=lambda: run.progress)
        for process in (simulation, loopback):
            with contextlib.suppress(psutil.NoSuchProcess):  # the demo may have ended them already
                process.resume()
    assert run.ended() == 0, run.progress + run.said
    assert "(the device answered no tick for fault.silence); all nodes are started anew" in run.progress
    assert json.loads(run.said)["done"] and (run.out / "first_start" / "bag" / "metadata.yaml").exists()


def node_of(run, module):
    """Its process, once it is there."""
    for node in children(run.process):
        with contextlib.suppress(psutil.NoSuchProcess):  # one that has just ended has no words
            if module in node.cmdline():
                return node
    return None


def test_a_fault_ends_a_demo_that_was_to_last_an_hour_and_its_cause_is_said(demo, ros_domain):
    run = demo("--json", "--seconds", "3600", *BUSY, scene="free_space")
    with contextlib.closing(Client.join("stops", ros_domain, NAMESPACE)) as client:

        def moves():
            client.look()
            return client.said("haptic_driver", "state") == "engaged" and client.motor_commanded

        until(moves, "the motor moves the handle", said=lambda: run.progress)
        client.call(trigger("haptic_driver/estop"), patience=LIMIT)
    assert run.ended() == 1
    found, fell = json.loads(run.said), "haptic_driver fell into fault estop (~/estop was called)"
    # whether the demo saw the motor between two looks, before it was stopped, is not said here
    assert found["why"].endswith(f": {fell}; what clears it: ~/reset, then ~/enable")
    assert found["faults"] == ["estop"] and not found["done"] and found["seconds"] > 0.0


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--scene", "no_such_scene"), "no_such_scene is neither a file nor a name"),
        (("--params", "no_such_file"), "no_such_file is neither a file nor a name"),
        (("--exchange", "carrier_pigeon"), "carrier_pigeon"),
        (("--rate", "1.0"), "1.0 Hz"),
    ],
)
def test_a_wrong_wish_is_refused_in_a_sentence_before_anything_starts(tmp_path, monkeypatch, capsys, options, sentence):
    monkeypatch.setattr(sys, "argv", ["haptic", "demo", "--out", str(tmp_path / "run"), *options])
    with pytest.raises(SystemExit) as refused:
        main.main()
    said = capsys.readouterr().err
    assert refused.value.code != 0 and sentence in said and "Traceback" not in said
    assert not (tmp_path / "run").exists()
