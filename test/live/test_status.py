# SPDX-License-Identifier: Apache-2.0
"""`haptic status` on a running node and among strange diagnostics; the listener of chaos among them too."""

import contextlib
import json
import signal
import sys

import pytest
from live_nodes import command, strange_diagnostics
from waiting import exit_code, run, until

from fault_injection.listener import Listener
from haptic_device.parameters import LOOPBACK_FIGURES

pytestmark = pytest.mark.timeout(600)

HAPTIC = [sys.executable, "-m", "haptic_sim.cli.main"]


def test_status_shows_every_figure_of_a_running_system_and_says_by_its_exit_code_whether_one_is_bad(start, tmp_path):
    def status():
        done = run([*HAPTIC, "status", "--json"])
        return json.loads(done.stdout), done.returncode

    assert status() == ({}, 1)
    node = start(command("haptic_loopback"))

    def serving():
        heard = status()
        return heard[0].get("haptic_loopback", {}).get("message") == "serving" and heard

    found, code = until(serving, "a haptic_loopback that serves")
    assert set(found) == {"haptic_loopback", *(f"haptic_loopback: {each.name}" for each in LOOPBACK_FIGURES)}
    assert found["haptic_loopback: energy"]["level"] == 0
    assert code == int(any(said["level"] >= 2 for said in found.values()))
    node.send_signal(signal.SIGINT)
    assert exit_code(node) == 0


def test_status_shows_strange_diagnostics_as_they_are_and_does_not_end():
    def heard(*options):
        done = run([*HAPTIC, "status", *options])
        assert done.returncode == 1 and "Traceback" not in done.stderr
        return all(name in done.stdout for name in ("seven", "all bits", "[/x]")) and done.stdout

    with strange_diagnostics():
        table = until(heard, "a strange status")
        said = until(lambda: heard("--json"), "a strange status")
    assert "[/x] [bold" in table and table.count("STALE") == 2
    said = json.loads(said)
    assert said["seven"]["level"] == said["all bits"]["level"] == 3 and said["[/x]"]["values"] == {"[/x]": "[/x]"}


def test_the_listener_of_chaos_goes_on_hearing_among_strange_diagnostics(ros_domain):
    with contextlib.closing(Listener(ros_domain)) as listener, strange_diagnostics():
        until(lambda: "[/x]" in listener.statuses, "a strange status")
        for _ in range(3):
            listener.statuses.clear()
            until(lambda: "[/x]" in listener.statuses, "the same again")
        assert listener.levels["seven"] == 3
