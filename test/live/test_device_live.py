# SPDX-License-Identifier: Apache-2.0
"""`haptic device` on a device that runs: what it owes, what it shows, how it is described, and who is not disturbed."""

import contextlib
import json

import pytest
from in_process import haptic
from live_nodes import command
from waiting import until

from haptic_device.description import load_device
from haptic_device.realtime import shared_memory
from haptic_device.yaml_reader import dump
from haptic_sim.client import Client
from haptic_sim.supervision import conformance, device_page, device_set_up

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


class Hand:
    """Answers a set-up by leading the loopback's hand, each place until the handle is there."""

    places = {
        "x.way": [(0.08, 0.0, 0.0)],
        "y.way": [(0.08, 0.08, 0.0)],
        "theta.way": [(0.08, 0.08, 2.0)],
        "zero": [(0.0, 0.0, 0.0)],
        "workspace": [(0.1, 0.1, 3.0), (-0.1, -0.1, -3.0)],
    }

    def __init__(self, client):
        self.client, self.said, self.walked = client, [], []

    def say(self, sentence):
        self.said.append(sentence)

    def known(self, key):
        return None

    def ready(self, key, todo, look):
        self.client.truths.clear()
        for place in self.places[key]:
            until(lambda place=place: self._there(place), f"the handle at {place}", look)
        if key == "workspace":
            self.walked = list(self.client.truths)

    def _there(self, place):
        self.client.aim(place)
        self.client.look()
        truth = self.client.truth
        at = [truth[axis] for axis in ("x", "y", "theta")] if truth else []
        return at and all(abs(p - q) < 0.002 and v == 0.0 for (p, v, _), q in zip(at, place, strict=True))

    def number(self, key, text, unit):
        return {"x.length": 0.08, "y.length": 0.08, "theta.length": 2.0}[key]

    def yes(self, key, text):
        return key.endswith(".push")

    def choice(self, key, text, options):
        return "absolute"


def test_moving_the_handle_finds_what_the_plant_is_made_of(ros_domain, start, tmp_path):
    desktop, described = load_device("desktop").model_dump(mode="json"), load_device("desktop")
    true = [{"encoder_sign": -1, "counts_per_unit": 90000.0, "zero": 0.03}, {"motor_sign": -1}, {"encoder_sign": -1}]
    for axis, differs in zip(desktop["axes"], true, strict=True):
        axis |= differs
    (tmp_path / "other.yaml").write_text(dump(desktop))
    start(command("haptic_loopback", device=str(tmp_path / "other.yaml"), motion__name="follow"))
    name = shared_memory.file_name(ros_domain, "/haptic")
    until(lambda: device_page.glance(name), "the loopback serves its page")
    with (
        contextlib.closing(Client.join("leads", ros_domain, "/haptic", every_truth=True)) as client,
        device_page.opened("desktop", ros_domain, None) as page,
    ):
        hand = Hand(client)
        found = device_set_up.set_up(hand, device_page.PageDevice(page), described, "found", push=1.0)
    assert hand.said == []
    for axis, truly in zip(found["axes"], desktop["axes"], strict=True):
        for sign in ("encoder_sign", "motor_sign"):
            assert axis[sign] == truly[sign], (axis["name"], sign)
        # the handle is within 2 mm of either place of a way of 80 mm
        assert axis["counts_per_unit"] == pytest.approx(truly["counts_per_unit"], rel=0.05)
        walked = [truth[axis["name"]][0] for truth in hand.walked]  # the hand swings beyond where it is led to
        assert axis["workspace"] == pytest.approx([min(walked), max(walked)], rel=0.1)
    assert found["axes"][0]["zero"] == pytest.approx(0.03, abs=0.004)
