# SPDX-License-Identifier: Apache-2.0
"""200 live changes of walls, gains, cancellation, limit and clutch by services: a hand presses, forces act late."""

import contextlib

import numpy as np
import pytest
import yaml

from haptic_device.config_files import find
from haptic_sim.exchange.simulation import ToolSample
from haptic_sim.supervision.mock_simulation import STILL, MockSimulation
from haptic_sim.supervision.pair import running
from haptic_sim.supervision.tuning import Tuning

pytestmark = pytest.mark.timeout(600)

BUDGET = 0.006  # [J] exchange.budget and passivity.budget
CHANGES, EACH = 200, 0.05  # [s] at least between two changes
DELAY = 0.0005  # [s] described, of the actuation
DRIVER = {"servo.rate": 1000.0, "fault.silence": 1.0, "fault.unattended": 0.0, "fault.saturation": 60.0}
DRIVER |= {"engage.time": 0.05, "engage.force": 100.0, "coupling.stiffness": 300.0, "coupling.damping": 0.1}
DRIVER |= {"coupling.rotational_stiffness": 0.1, "coupling.rotational_damping": 0.0, "fault.duty_time": 3600.0}
HAND = {"motion.name": "follow", "motor_watchdog": 2.0, "motion.lag": 0.05}


class Standing(MockSimulation):
    """A tool that stands where it is, so that the coupling is stretched."""

    def exchange(self, handle, most=None):
        return ToolSample(STILL, STILL, STILL, True, 0.0)


@pytest.fixture
def late_device(tmp_path):
    """Path of the desktop device's description with a delay of its actuation."""
    described = yaml.safe_load(find("devices", "desktop").read_text())
    path = tmp_path / "late.yaml"
    path.write_text(yaml.safe_dump(described | {"name": "late", "actuation_delay": DELAY}))
    return str(path)


def change(dice):
    """Parameters of one change, `__` for the dot."""
    kind = dice.integers(0, 5)
    if kind == 0:
        return {"cancellation__ratio": float(dice.choice([0.0, 0.1, 0.2]))}
    if kind == 1:
        return {"force__limit": float(dice.choice([0.5, 3.0, 15.0]))}
    if kind == 2:
        return {"clutch__open": bool(dice.integers(0, 2))}
    if kind == 3:
        return {"coupling__stiffness": float(dice.choice([0.0, 150.0, 300.0]))}
    count = dice.integers(1, 4)
    angles = dice.uniform(0.0, 2.0 * np.pi, count)
    return {
        "wall__normals": tuple(np.ravel([np.cos(angles), np.sin(angles)], order="F").tolist()),
        "wall__offsets": tuple(dice.uniform(-0.02, 0.03, count).tolist()),
        "wall__stiffness": tuple(dice.choice([100.0, 400.0], count).tolist()),
        "wall__damping": (0.1,) * count,
    }


def test_200_changes_by_services_under_a_pressing_hand_give_no_more_than_the_budget(late_device, monkeypatch):
    monkeypatch.setattr("haptic_sim.supervision.tuning.MockSimulation", Standing)
    dice, taken = np.random.default_rng(38), 0
    driver, hand = DRIVER | {"device": late_device}, HAND | {"device": late_device}
    with running(None, None, driver, hand) as (domain, namespace, check):
        tuning = Tuning(domain, namespace, tool=True)
        with contextlib.closing(tuning):
            tuning.wait_engaged(check)
            tuning.wait_answered(check)
            for k in range(CHANGES):
                with contextlib.suppress(ValueError):  # the driver's refusal of gains beyond the device's damping
                    tuning.set(**change(dice))
                    taken += 1
                angle = 0.2 * k
                tuning.watch(EACH, lambda t, a=angle: (0.02 * np.cos(a), 0.02 * np.sin(a), 0.0))
            check()
    pushed = [abs(truth["motor_x"][2]) for truth in tuning.truths]
    assert taken > CHANGES // 2
    assert len(tuning.truths) > 2 * CHANGES and max(pushed) > 1.0
    assert max(truth["energy_given"][0] for truth in tuning.truths) <= BUDGET
