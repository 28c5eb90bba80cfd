# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` alive: the job is done, and no way of ending it leaves anything behind."""

import contextlib
import fcntl
import json
import os
import pty
import re
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from haptic_device.analysis.recording import load
from haptic_sim.recompute import verdict_on

ROOT = Path(__file__).resolve().parent.parent
HAPTIC = [sys.executable, "-m", "haptic_sim.cli.main"]
NODES = ("haptic_driver", "haptic_loopback", "haptic_recorder", "haptic_simulation")


def start(out: Path, *options: str) -> subprocess.Popen:
    command = [*HAPTIC, "demo", "--out", str(out), *options]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def pages() -> set[str]:
    """Shared memory that is not the middleware's own (which only a killed process leaves)."""
    return {path.name for path in Path("/dev/shm").iterdir() if "fastrtps" not in path.name}


def flat(found: dict, prefix: str = "") -> set[str]:
    keys = set()
    for key, value in found.items():
        keys |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key}
    return keys


def documented() -> set[str]:
    text = (ROOT / "docs" / "cli.md").read_text().split("| key |")[1]
    return set(re.findall(r"^\| `([\w.]+)` \|", text, re.MULTILINE))


def wait_for(condition, seconds: float = 40.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "what was waited for did not come"
        time.sleep(0.05)


def test_the_peg_goes_into_the_hole_and_every_figure_is_reported(tmp_path):
    demo = start(tmp_path / "run", "--json")
    said, progress = demo.communicate(timeout=120)
    assert demo.returncode == 0, progress
    found = json.loads(said)
    assert found["done"] and found["faults"] == [] and found["result"]["insertion_fraction"] >= 0.95
    assert flat(found) == documented()
    assert found["exchange"]["answered"] >= 0.9 * found["exchange"]["sent"] > 0
    assert found["contact"]["max_penetration_m"] <= 1e-4
    recording = load(Path(found["bag"]))
    assert recording.notes == () and recording.trace_rows_missing == 0
    again = verdict_on(recording.trace, recording.clouds["snapshot"])
    assert again.different == 0 and again.same == len(recording.trace) - before_it_can_be(recording)
    later = verdict_on(recording.trace[100:], recording.clouds["snapshot"])
    assert later.same > 0 and later.different == 0  # from memory that was copied while the servo ran
    assert {"trial.yaml", "made.yaml", "device/desktop.yaml", "scene/peg_in_hole.yaml"} <= set(recording.attachments)
    assert Path(found["report"]).read_bytes().startswith(b"\x89PNG")


def before_it_can_be(recording):
    """Ticks up to the first snapshot within the trace; none if the recorder heard the servo from its first tick on."""
    ticks, snapshots = recording.trace["tick"], recording.clouds["snapshot"]["tick"]
    if ticks[0] == 0:
        return 0
    return int(np.searchsorted(ticks, snapshots[snapshots >= ticks[0] - 1].min(), side="right"))


def running(processes):
    """Those that still run; one that has ended may wait as a zombie for somebody to ask how."""
    found = []
    for each in processes:
        with contextlib.suppress(psutil.NoSuchProcess):
            found += [each] if each.status() != psutil.STATUS_ZOMBIE else []
    return found


@pytest.mark.parametrize(("number", "after"), [(signal.SIGINT, 0.9), (signal.SIGTERM, 2.0), (signal.SIGINT, 5.0)])
def test_an_interrupt_leaves_no_process_no_page_and_no_half_written_bag(tmp_path, number, after):
    before = pages()
    demo = start(tmp_path / "run")
    time.sleep(after)
    children = psutil.Process(demo.pid).children(recursive=True)
    demo.send_signal(number)
    demo.communicate(timeout=30)
    assert demo.returncode == 130
    assert not running(children) and pages() <= before
    bag = tmp_path / "run" / "bag"
    assert not bag.exists() or (bag / "metadata.yaml").exists()


@pytest.mark.parametrize("end", ["terminal closed", "command killed"])
def test_a_closed_terminal_and_a_killed_command_leave_no_process_and_no_page(tmp_path, end):
    before, (control, terminal) = pages(), pty.openpty()
    options = {"stdin": terminal, "stdout": terminal, "stderr": terminal, "start_new_session": True}
    own = [*HAPTIC, "demo", "--scene", "free_space", "--out", str(tmp_path / "run")]
    demo = subprocess.Popen(own, cwd=ROOT, preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0), **options)
    os.close(terminal)
    wait_for((tmp_path / "run" / "bag").exists)
    children = psutil.Process(demo.pid).children()  # a node may ask git for a moment what it was made of
    if end == "command killed":
        demo.kill()
    os.close(control)
    demo.wait(30)
    wait_for(lambda: not running(children) and pages() <= before)
    assert len(children) == len(NODES)


def test_a_dead_node_ends_the_demo_and_is_named(tmp_path):
    demo = start(tmp_path / "run", "--json")
    bag = tmp_path / "run" / "bag"
    wait_for(bag.exists)
    children = psutil.Process(demo.pid).children()
    victim = next(child for child in children if "haptic_sim.node.simulation" in child.cmdline())
    victim.kill()
    said, progress = demo.communicate(timeout=60)
    assert demo.returncode == 1 and "haptic_simulation ended with exit code -9" in progress
    assert not json.loads(said)["done"] and (bag / "metadata.yaml").exists()
    assert not running(children)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--scene", "no_such_scene"), "no_such_scene is neither a file nor a name"),
        (("--params", "no_such_file"), "no_such_file is neither a file nor a name"),
        (("--exchange", "carrier_pigeon"), "carrier_pigeon"),
        (("--rate", "1.0"), "1.0 Hz"),
    ],
)
def test_a_wrong_wish_is_refused_in_a_sentence_before_anything_starts(tmp_path, options, sentence):
    demo = start(tmp_path / "run", *options)
    _, said = demo.communicate(timeout=30)
    assert demo.returncode != 0 and sentence in said and "Traceback" not in said
    assert not (tmp_path / "run").exists()
