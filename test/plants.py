# SPDX-License-Identifier: Apache-2.0
"""The device's plant and hand as both libraries have them, haptic_device's and the firmware's, by one interface.

Each axis is (m, b, f_c, g, m_h, b_h, k_h, start); times in s from 0, waypoints (time, x, y, theta, grip).
"""

import ctypes
from types import SimpleNamespace

import firmware_builds
import numpy as np

from haptic_device.config.description import SUB_STEP
from haptic_device.device import operator_hand, plant

FREE = (0.1, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
FIELDS = "mass", "damping", "coulomb", "gravity", "hand_mass", "hand_damping", "hand_stiffness"


def ns(time):
    return round(time * 1e9)


class InPython:
    """haptic_device.device.plant, as the simulated device advances it."""

    SENSED = 2e-12  # [m] how far its encoder is off
    SAME = "position", "velocity", "target", "target_velocity"
    PARTS = dict(zip(SAME, SAME, strict=True)) | {"motor": "motor_force", "operator": "operator_force"}

    def __init__(self, x=FREE, y=FREE, theta=FREE, sensing=0.0, actuation=0.0, **changes):
        axes, self.record, self.memory = (
            np.array([x, y, theta]),
            np.zeros(1, plant.PLANT),
            np.zeros(1, plant.PLANT_MEMORY),
        )
        for field, numbers in zip(FIELDS, axes.T, strict=False):
            self.record[field] = numbers
        self.record["axes"], self.record["force_per_motor"], self.record["force_limit"] = 3, 1.0, 100.0
        self.record["sensing_delay"], self.record["actuation_delay"] = ns(sensing), ns(actuation)
        self.record["position_per_count"] = 1e-12
        for field, value in changes.items():
            self.record[field] = value
        self.memory["position"] = self.memory["target"] = axes[:, -1]
        self.motion, self.begun = np.zeros(1, operator_hand.MOTION), 0.0
        self.script((0.0, *axes[:, -1], 1.0))

    def script(self, *waypoints):
        """The hand begins to go by these now."""
        numbers, self.begun = np.array(waypoints), self.memory["time"][0] * 1e-9
        self.motion["count"] = len(numbers)
        for name, values in (("times", numbers[:, 0]), ("points", numbers[:, 1:4]), ("grip", numbers[:, 4])):
            self.motion[name][0, : len(numbers)] = values

    def push(self, time, *force):
        """Pushes with the motor; from when on it acts."""
        self.at(time)
        plant.push_motor(self.record[0], self.memory[0], ns(time), np.array([*force, 0.0, 0.0, 0.0][:3]))
        return time + self.record["actuation_delay"][0] * 1e-9

    def at(self, time):
        """The state at this time: arrays of 3, and energy."""
        now, target, before = self.memory[0], np.zeros(3), np.zeros(3)
        plant.take_motor(self.record[0], now)
        while now["time"] < ns(time):
            end = plant.next_change(now, min(ns(time), int(now["time"]) + SUB_STEP))
            grip = operator_hand.target_at(self.motion[0], now["time"] * 1e-9 - self.begun, before)
            operator_hand.target_at(self.motion[0], end * 1e-9 - self.begun, target)
            plant.sub_step(self.record[0], now, end, target, grip)
            plant.take_motor(self.record[0], now)
        parts = {told: now[field].copy() for told, field in self.PARTS.items()}
        return SimpleNamespace(energy=float(now["energy_given"]), sensed=self.sense()[0] * 1e-12, **parts)

    def sense(self):
        """Counts and drag now."""
        counts, drag = np.zeros(3), np.zeros(3)
        plant.sense(self.record[0], self.memory[0], int(self.memory["time"][0]), counts, drag)
        return counts, drag


class InC:
    """The reference device's."""

    SENSED = 2e-10  # it goes straight between steps of 10 us
    PARTS = ("position", "velocity", "motor", "operator", "target", "target_velocity", "sensed")

    def __init__(self, x=FREE, y=FREE, theta=FREE, sensing=0.0, actuation=0.0):
        self.port = firmware_builds.ports()
        delays = ctypes.c_int64(ns(sensing)), ctypes.c_int64(ns(actuation))
        self.port.plant_port_begin((ctypes.c_double * 8 * 3)(x, y, theta), *delays)

    def script(self, *waypoints):
        for numbers in waypoints:
            self.port.plant_port_waypoint(*map(ctypes.c_double, numbers))
        self.port.plant_port_script()

    def push(self, time, *force):
        values = (ctypes.c_double * 3)(*force, *[0.0] * (3 - len(force)))
        return self.port.plant_port_push(ctypes.c_int64(ns(time)), values) * 1e-9

    def at(self, time):
        self.port.plant_port_advance(ctypes.c_int64(ns(time)))
        state = (ctypes.c_double * 22)()
        self.port.plant_port_state(state)
        parts = {name: np.array(state[3 * i : 3 * i + 3]) for i, name in enumerate(self.PARTS)}
        return SimpleNamespace(energy=state[21], **parts)
