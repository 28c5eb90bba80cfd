# SPDX-License-Identifier: Apache-2.0
"""Parameters of a driver that runs: set, refused as a whole, left as they were found."""

import contextlib

import pytest
from in_process import haptic
from live_nodes import DISPLAY
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from haptic_device.message_fields import exchange_names
from haptic_display.device_tools.tuning import Tuning
from haptic_display.run.processes import NAMESPACE
from haptic_display.service_requests import get_parameters

NODES = DISPLAY
BEYOND = "haptic: coupling.stiffness 90000 N/m with coupling.damping"
WALL = {"wall.normals": (1.0, 0.0), "wall.offsets": (-0.05,), "wall.stiffness": (200.0,), "wall.damping": (0.1,)}


def test_a_value_is_set_as_a_parameter_file_has_it_and_got_back_and_one_beyond_its_bound_is_refused(display):
    done = haptic("set", "haptic_driver", "coupling.stiffness", "3e2")
    assert (done.returncode, done.stdout, done.stderr) == (0, "300.0\n", "")
    refused = haptic("set", "haptic_driver", "coupling.stiffness", "90000")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert refused.stderr.startswith(BEYOND) and refused.stderr.count("\n") == 1
    assert haptic("get", "haptic_driver", "coupling.stiffness").stdout == "300.0\n"


def test_of_a_request_at_once_with_one_refused_gain_none_is_in_force_and_the_servo_keeps_its_gains(display):
    assert display.set("coupling.stiffness", 200.0) == (True, "")
    before = display.told(get_parameters("haptic_driver", list(WALL)))
    wishes = WALL | {"coupling.stiffness": 100.0, "wall.stiffness": (90000.0,)}
    entries = [Parameter(name, value=value).to_parameter_msg() for name, value in wishes.items()]
    request = SetParametersAtomically.Request(parameters=entries)
    result = display.ask("haptic_driver/set_parameters_atomically", request).result
    assert not result.successful and "wall.stiffness 90000 N/m" in result.reason
    assert display.told(get_parameters("haptic_driver", list(WALL))) == before
    display.hear_handles()
    display.handles.clear()
    told = exchange_names(3).index("stiffness")
    display.until(lambda: len(display.handles) > 20, "handle samples after the refusal")
    assert {handle.position[told] for handle in display.handles} == {200.0}
    display.hear_handles(False)


def test_gains_are_as_they_were_after_an_interrupt_of_the_tool_that_set_them(display, ros_domain):
    display.engaged()
    gains = (*WALL, "passivity.policy", "coupling.stiffness")
    with contextlib.closing(Tuning(ros_domain, NAMESPACE)) as tuning:
        tuning.wait_engaged()
        before = tuning.get(gains)
        with pytest.raises(KeyboardInterrupt), tuning.as_found(gains):
            walls = {name.replace(".", "__"): value for name, value in WALL.items()}
            tuning.set(**walls, passivity__policy="off", coupling__stiffness=10.0)
            assert tuning.get(["wall.stiffness"]) == {"wall.stiffness": (200.0,)}
            raise KeyboardInterrupt
        assert tuning.get(gains) == before
