# SPDX-License-Identifier: Apache-2.0
"""A knob on a moteus drive, emulated: driver and bridge press it, and whoever ends, the drive's last word is no torque.

The drive's own watchdog is made long here: what switches the motor off is the bridge.
"""

import signal

import pytest
from codec_host import Emulator, patient_knob
from live_nodes import HOLDING, Nodes
from waiting import exit_code, until

WEAK = {"wall__normals": [1.0, 0.0], "wall__offsets": [0.11], "wall__stiffness": [5.0], "wall__damping": [0.0]}
SOFT = {"coupling__stiffness": 100.0, "coupling__damping": 0.1, **HOLDING}
DRIVER = {"servo__rate": 1000.0, "engage__time": 0.05, "fault__silence": 1.0, "auto_enable": True, **WEAK, **SOFT}
"""The knob stands 80 mm within the wall when it is enabled, and is pushed out with 0.4 N in a second or so."""
PUSH = 0.002  # [N m] that shows a force


@pytest.fixture
def knob(start, tmp_path):
    """The emulated drive; `knob.device`: its description."""
    knob = Emulator(start, "moteus", tmp_path / "log", 1)
    knob.log = tmp_path / "log"
    knob.device = tmp_path / "knob.yaml"
    patient_knob(knob, knob.device)
    return knob


def torque(knob):
    """What the motor does [N m]."""
    return (knob.torque() or (1.0, 0.0))[1]


def gave_up(knob):
    """How often the drive's own watchdog has switched it off while it pushed."""
    lines = [line.split()[1:] for line in knob.log.read_text().splitlines()]
    words = [line for line in lines if line[0] in ("torque", "mode")]
    pushes = [line[0] == "torque" and float(line[2]) != 0.0 for line in words]
    return sum(push and after == ["mode", "1", "11"] for push, after in zip(pushes, words[1:], strict=False))


@pytest.fixture
def own(ros_domain, nodes, tmp_path):
    with Nodes(tmp_path) as own:
        yield own


def pressing(knob, own):
    """A driver whose wall pushes the knob."""
    driver = own.start("haptic_driver", device=str(knob.device), **DRIVER)

    def pushes():
        assert driver.poll() is None, driver.log.read_text()
        return torque(knob) > PUSH

    until(pushes, "the wall pushes", said=driver.log.read_text)
    return driver


def test_whoever_ends_the_motor_is_switched_off_by_the_bridge_and_stays_so(knob, own):
    bridge = own.start("haptic_bridge", device=str(knob.device), motor_watchdog=0.3)
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
        driver = pressing(knob, own)
        driver.send_signal(number)
        until(lambda: torque(knob) == 0.0, "the motor is off")
        assert exit_code(driver, driver.log.read_text) == (-number if number == signal.SIGKILL else 0)
        assert torque(knob) == 0.0
    driver = pressing(knob, own)
    bridge.send_signal(signal.SIGTERM)
    assert exit_code(bridge, bridge.log.read_text) == 0
    assert torque(knob) == 0.0
    driver.send_signal(signal.SIGINT)
    assert exit_code(driver, driver.log.read_text) == 0
    assert torque(knob) == 0.0 and gave_up(knob) == 0
