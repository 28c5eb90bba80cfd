# SPDX-License-Identifier: Apache-2.0
"""`haptic get`, `set`, `save` and `status` on a running display, among strangers, and beside another display."""

import json
import time

import numpy as np
import pytest
from in_process import haptic
from lifecycle_msgs.msg import State, Transition
from live_nodes import DISPLAY, SLOW
from waiting import until

from haptic_device.config import yaml_reader
from haptic_device.config.parameters import DRIVER, LOOPBACK_FIGURES
from haptic_display.service_requests import change_state

NODES = DISPLAY
CIRCLE = {"motion__name": "circle", "motion__radius": 0.04, "motion__duration": 60.0, "motion__turns": 60.0}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ("get", "haptic_driver", "coupling.stifness"),
            "coupling.stifness is not a parameter of haptic_driver; did you",
        ),
        (("set", "haptic_driver", "coupling.stiffness", "{a: 1}"), "'{a: 1}' is no value of one parameter"),
        (("set", "haptic_driver", "servo.rate", "2000"), "Trying to set a read-only parameter: servo.rate."),
        (("get", "haptic_drivr"), "haptic_drivr offers no ~/list_parameters in /haptic; does it run in this domain?"),
        (("save", "new.yaml", "--namespace", "/nowhere"), "no node of a display is found in /nowhere; does it run in"),
    ],
)
def test_what_is_refused_is_said_in_the_nodes_own_sentence(display, words, sentence):
    done = haptic(*words)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"haptic: {sentence}") and done.stderr.count("\n") == 1


def test_without_a_name_all_parameters_are_printed_as_a_file_has_them(display):
    found = yaml_reader.loads(haptic("get", "haptic_driver").stdout, ros=True)
    assert set(found) == {parameter.name for parameter in DRIVER}
    assert found["servo.rate"] == SLOW["servo__rate"] and found["wall.offsets"] == []


def test_who_activates_an_active_node_is_answered(display, nodes):
    assert display.told(change_state("haptic_loopback", Transition.TRANSITION_ACTIVATE))[0] is False
    said = "haptic_loopback is active; there is no transition activate from there"
    assert said in nodes.running["haptic_loopback"].log.read_text()


def test_what_is_saved_passes_check_and_is_not_overwritten(display, tmp_path):
    assert haptic("set", "haptic_driver", "coupling.stiffness", "350").returncode == 0
    file = tmp_path / "point.yaml"
    done = haptic("save", file)
    assert done.stdout == f"{file} holds the parameters of haptic_driver, haptic_loopback, haptic_simulation\n", done
    checked = haptic("check", file)  # on a late machine a remark follows
    assert checked.returncode == 0 and checked.stdout.startswith(f"{file}: ok"), checked
    again = haptic("save", file)
    assert (again.returncode, again.stderr) == (1, f"haptic: {file} exists already; name a new file\n")
    saved = {
        key.rpartition("/")[2]: section["ros__parameters"] for key, section in yaml_reader.load(file, ros=True).items()
    }
    assert saved["haptic_driver"]["coupling.stiffness"] == 350.0
    assert saved["haptic_simulation"]["scene"] == "free_space" and saved["haptic_loopback"]["motion.name"] == "follow"


def test_a_loopback_activated_again_begins_its_script_anew(nodes, ear):
    def away(truth):
        return np.abs(truth.position[3:5]).max() > CIRCLE["motion__radius"]

    nodes.end("haptic_loopback")
    began = time.monotonic()
    nodes.start("haptic_loopback", **CIRCLE)
    ear.truth(lambda truth: ear.time(truth) > began, what="the new device's handle")
    ear.cleared()
    ear.engaged()
    ear.truth(away, what="the hand is on its circle")
    assert ear.trigger("disable")[0]  # else it would begin at once, by the last word of the driver
    ear.change("haptic_loopback", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    ear.change("haptic_loopback", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
    first = ear.truth(lambda truth: True)
    assert np.abs(first.position[:6]).max() < 1e-6
    ear.cleared()
    ear.engaged()
    ear.truth(away, what="the hand is on its circle again")


def test_status_shows_every_figure_of_a_running_display_and_says_by_its_exit_code_that_one_is_bad(display):
    def status(*words):
        done = haptic("status", "--json", *words)
        return json.loads(done.stdout), done.returncode

    found, code = status("--namespace", "/nobody")
    assert "/haptic/haptic_driver" in found["/nobody"]["message"] and code == 1
    assert display.trigger("estop")[0]

    def heard():
        found = status()
        stopped = "fault estop" in found[0].get("haptic_driver", {}).get("message", "")
        return stopped and "haptic_loopback" in found[0] and found

    found, code = until(heard, "the status")
    figures = {"haptic_loopback", *(f"haptic_loopback: {each.name}" for each in LOOPBACK_FIGURES)}
    assert {name for name in found if name.startswith("haptic_loopback")} == figures
    assert found["haptic_loopback"]["message"] == "serving"
    assert (found["haptic_driver"]["level"], code) == (2, 1)


def test_status_shows_the_displays_of_every_namespace_or_of_one(nodes):
    def status(*words):
        return set(json.loads(haptic("status", "--json", *words).stdout))

    nodes.end("haptic_loopback")
    nodes.start("haptic_loopback", namespace="/left")
    until(lambda: {"/haptic/haptic_driver", "/left/haptic_loopback"} <= status(), "both displays")
    assert "haptic_loopback" in (left := status("--namespace", "/left")) and "haptic_driver" not in left
