# SPDX-License-Identifier: Apache-2.0
"""A live driver whose servo has a wall, a hand that presses it, and the faults that follow."""

import time

from live_nodes import HOLDING

from haptic_display.service_requests import set_parameters

WALL = {"wall.normals": [1.0, 0.0], "wall.offsets": [-0.01], "wall.stiffness": [400.0], "wall.damping": [0.0]}
WALL |= {"coupling.stiffness": 100.0, "coupling.damping": 0.1, **HOLDING}
"""Soft, so that it is taken of a servo that other work on the machine makes milliseconds late."""
ERROR = 2


def build(ear):
    """Gives the driver a wall that pushes on after a stall."""
    answer = ear.told(set_parameters("haptic_driver", WALL))
    assert answer[0], answer
    return ear


def press(ear):
    """Has the hand press the wall until the motor holds more than 5 N against it."""
    ear.go_to(0.0)
    ear.engaged()
    ear.go_to(-0.06)
    ear.truth(lambda truth: ear.motor(truth)[0] > 5.0, what="the motor holds 5 N")


def provoke(ear, name, act):
    """Does act(), which ends in this fault: told, latched, and the motor off."""
    begin = len(ear.said["haptic_driver"])

    def told():
        return next((said for said in ear.said["haptic_driver"][begin:] if said[2]["fault"] == name), None)

    act()
    level, message, values = ear.until(told, f"the fault {name}")
    assert (level, message, values["state"]) == (ERROR, f"fault {name}", "fault")
    ear.motor_off_after(time.monotonic())
    assert ear.trigger("enable") == (False, f"fault {name} is latched; call ~/reset first")
