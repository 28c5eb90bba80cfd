# SPDX-License-Identifier: Apache-2.0
"""haptic_loopback alive and alone: the hand moves the handle, the truth is told, the page comes and goes."""

import math
import time

import pytest
from lifecycle_msgs.msg import State, Transition
from live_nodes import DISPLAY, page_path

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import LOOPBACK
from haptic_device.device import loopback_config, simulated_device
from haptic_device.message_fields import AXES
from haptic_device.nodes import messages

NODES = {"haptic_loopback": DISPLAY["haptic_loopback"]}


def test_without_a_driver_the_handle_lives_on_with_its_motor_at_zero(ear):
    said = ear.news("haptic_loopback", lambda level, message, values: values["driven"] == "False")
    assert said[:2] == (0, "serving")
    asked, begin = time.monotonic(), len(ear.truths)
    truth = ear.truth(lambda truth: ear.time(truth) > asked + 0.1, what="0.1 s of the plant")
    assert ear.time(truth) <= time.monotonic()  # it is never ahead
    assert not any(ear.motor(truth).any() for truth in ear.truths[begin:])


def test_the_hand_takes_the_handle_to_its_target_within_the_friction_it_feels(ear):
    ear.go_to(-0.03, 0.04, -1.0)
    still = ear.truth(lambda truth: abs(truth.velocity[:3]).max() == 0.0, what="the handle is still")
    assert abs(still.position[:2] - [-0.03, 0.04]).max() <= 0.02 / 500.0 * 1.01
    assert abs(still.position[2] + 1.0) <= 0.0001 / 1.0 * 1.01
    assert abs(still.effort[:2]).max() <= 0.02 * 1.01


def test_wrong_targets_move_nothing_and_are_counted_and_one_beyond_the_workspace_ends_at_its_edge(ear):
    ear.go_to(0.0)
    before = int(ear.news("haptic_loopback", lambda level, message, values: True)[2]["refused_targets"])
    wrong = [(["x", "y"], [0.1, 0.1]), (["x", "y", "z"], [0.1] * 3), (list(AXES), [0.1, math.nan, 0.1])]

    def counted(level, message, values):
        for names, position in wrong:
            ear.target.publish(messages.JointState(name=names, position=position))
        return int(values["refused_targets"]) >= before + len(wrong)

    ear.news("haptic_loopback", counted, what="wrong targets are counted")
    assert abs(ear.truth(lambda truth: True).position[3:6]).max() < 1e-5

    def ends(truth):
        ear.target.publish(messages.JointState(name=list(AXES), position=[5.0, 0.0, 0.0]))
        return abs(truth.position[3] - 0.12) < 1e-6

    ear.truth(ends, what="the target is at the edge")
    assert max(truth.position[3] for truth in ear.truths) <= 0.12


def at_rest(truth):
    return abs(truth.velocity[:3]).max() == 0.0 and abs(truth.position[3:5] - truth.position[:2]).max() < 1e-3


def test_the_energy_of_a_live_motion_is_that_of_the_same_motion_in_lock_step(ear):
    ear.go_to(0.0)
    before = ear.truth(at_rest, what="the handle is still at the middle")
    ear.go_to(0.05, -0.05)
    after = ear.truth(at_rest, what="the handle is still at its target")
    given = after.position[6] - before.position[6]
    path = abs(after.position[:2] - before.position[:2]).sum()
    assert -given > 0.02 * path  # what friction alone takes
    values = defaults(LOOPBACK) | {"motion.name": "follow"}
    plant, memory, motion = loopback_config.hand_from(load_device("desktop"), values)
    memory["position"], memory["target"] = before.position[:3], before.position[3:6]
    memory["time"], motion["points"][0, 0] = 1, (0.05, -0.05, 0.0)
    simulated_device.advance(plant[0], memory[0], motion[0], 2_000_000_000)
    assert given == pytest.approx(memory["energy_given"][0], rel=1e-3)
    assert after.position[:3] == pytest.approx(memory["position"][0], abs=1e-5)


def test_deactivated_it_is_silent_and_activated_it_goes_on(ear):
    ear.change("haptic_loopback", Transition.TRANSITION_DEACTIVATE, State.PRIMARY_STATE_INACTIVE)
    stopped = time.monotonic()
    ear.change("haptic_loopback", Transition.TRANSITION_CLEANUP, State.PRIMARY_STATE_UNCONFIGURED)
    assert not page_path().exists()
    ear.change("haptic_loopback", Transition.TRANSITION_CONFIGURE, State.PRIMARY_STATE_INACTIVE)
    assert page_path().exists() and not any(ear.time(truth) > stopped for truth in ear.truths)
    ear.change("haptic_loopback", Transition.TRANSITION_ACTIVATE, State.PRIMARY_STATE_ACTIVE)
    ear.truth(lambda truth: ear.time(truth) > stopped, what="it goes on")
