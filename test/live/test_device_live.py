# SPDX-License-Identifier: Apache-2.0
"""`haptic device` on a device that runs: what it owes, what it shows, how it is described, and who is not disturbed."""

import contextlib
import json

import pytest
from in_process import haptic
from live_nodes import command
from waiting import until

from haptic_device.realtime import shared_memory
from haptic_display.device_tools import conformance, device_page

NOBODY = "haptic device test: no device answers on its page within 3 s; start haptic_bridge or haptic_loopback there"


@pytest.fixture(scope="module")
def judged():
    """(how the command ended, {name: result}) of the loopback."""
    ended = haptic("device", "test", "desktop", "--json")
    return ended, {one["name"]: one for one in json.loads(ended.stdout)["checks"]}


def test_the_loopback_keeps_every_promise_but_for_time_to_who_asks_by_the_command(judged):
    ended, results = judged
    assert list(results) == list(conformance.CHECKS)
    broken = [one["sentence"] for name, one in results.items() if name != conformance.IN_TIME and not one["passed"]]
    assert broken == [] and "the motor of x is given 0.01 motor units" in ended.stderr


@pytest.mark.realtime
def test_the_loopback_is_in_time_and_the_exit_code_says_that_every_promise_is_kept(judged):
    ended, results = judged
    assert results[conformance.IN_TIME]["passed"], results[conformance.IN_TIME]["sentence"]
    assert ended.returncode == 0


def test_where_a_driver_holds_the_page_nothing_is_tried(ros_domain):
    name = shared_memory.file_name(ros_domain, "/haptic")
    with contextlib.closing(shared_memory.SharedMemory(name, shared_memory.SERVO)) as held:
        held.words[:] = 7
        ended = haptic("device", "test", "--domain", ros_domain)
        assert ended.returncode == 2 and ended.stdout == ""
        [said] = ended.stderr.strip().splitlines()
        assert (
            said == f"haptic device test: page {held.path} is held by another servo; stop it, or use another namespace"
        )
        assert set(held.words.tolist()) == {7}


def test_where_nothing_runs_that_is_said_and_no_page_is_left(ros_domain):
    ended = haptic("device", "test", "--domain", ros_domain)
    assert ended.returncode == 2 and ended.stderr.strip() == NOBODY
    assert not (shared_memory.FOLDER / shared_memory.file_name(ros_domain, "/haptic")).exists()
    shown = haptic("device", "show", "--json")
    assert shown.returncode == 1 and json.loads(shown.stdout) == {}


def test_a_device_that_runs_is_shown_with_counts_and_status(ros_domain, start):
    start(command("haptic_loopback", motion__name="hold", motion__start=[0.01, -0.02, 0.3]))
    name = shared_memory.file_name(ros_domain, "/haptic")
    until(lambda: device_page.glance(name), "the loopback serves its page")

    def shown():
        ended = haptic("device", "show", "--domain", ros_domain, "--json")
        return ended if "haptic_loopback" in ended.stdout and ended.returncode == 0 else None

    figures = json.loads(until(shown, "its diagnostics are heard").stdout)
    assert [figures[f"counts {axis}"][0] for axis in ("x", "y", "theta")] == ["2000", "-4000", "12000"]
    assert figures["status of the device"] == ["motors cut by its watchdog", ""]
    assert figures["device"] == ["desktop", ""]
