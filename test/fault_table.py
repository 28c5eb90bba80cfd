# SPDX-License-Identifier: Apache-2.0
"""A servo with its inputs in a test's hands, and how each fault of the table comes about on it."""

import math
from typing import NamedTuple

import numpy as np
from lockstep_systems import device, values
from ticks import tick

from haptic_device.config import kinematics
from haptic_device.control import controller_config, enable_state, faults, records

PERIOD = 1 / 4000.0
WALL = {"wall__normals": (1.0, 0.0), "wall__offsets": (0.0,), "wall__stiffness": (1000.0,), "wall__damping": (0.0,)}
FREE = {f"coupling__{turning}{gain}": 0.0 for turning in ("", "rotational_") for gain in ("stiffness", "damping")}
COUNTS = 1e7  # per metre
SETTLED = {}  # memory and row after a second at rest, for each settings there were: the second is the same each time


class Servo:
    """The servo with its inputs in a test's hands; ticks follow each other on time unless told otherwise."""

    def __init__(self, axes=3, scale=(1.0, 1.0), gravity=(0.0, 0.0), settled=True, **given):
        self.device = device(damping=3.0, counts=COUNTS, axes=axes, scale=scale, gravity=gravity)
        given = {"exchange__method": "direct"} | given  # the tool as it is; the other methods have tests of their own
        self.settings = controller_config.settings_from(self.device, values("haptic_driver", **given))
        self.memory, self.now, self.command = np.zeros(1, records.STATE), 10**12, enable_state.ENABLE
        self.inputs = {"tool_age": -1.0, "device_status": faults.FRESH}
        self.left = {}  # in the outputs of each row, of a tick before
        self.position = np.zeros(3)
        self.rows, self.known = [], self.settings.tobytes()
        if settled:
            self._settle()

    def _settle(self):
        known = self.settings.tobytes()
        if known not in SETTLED:
            self.run(1.0)
            SETTLED[known] = self.memory.copy(), self.rows[-1], self.now
        memory, row, self.now = SETTLED[known]
        self.memory[:], self.rows = memory, [row.copy()]

    def tick(self, stale=False, **changes):
        """One tick; inputs in changes last for this tick only. The device is at self.position."""
        row = np.zeros(1, records.TRACE_ROW)
        self.now += round(PERIOD * 1e9)
        counts = np.round(self.position / self.settings["hardware"]["position_per_count"][0, :3].clip(1e-12))
        given = {"deadline": self.now, "latched": self.now, "counts": counts, "command": self.command}
        given |= self.left | self.inputs | changes
        if stale:
            given["latched"] = self.memory["motion"]["sample_time"][0]
        for name, value in given.items():
            row[name] = value
        if self.settings.tobytes() != self.known:  # as a driver counts what it hands on
            self.settings["version"] += 1
            self.known = self.settings.tobytes()
        tick(self.settings, self.memory, row)
        self.rows.append(row)
        return row.view(np.recarray)[0]

    def run(self, seconds, **changes):
        for _ in range(round(seconds / PERIOD)):
            row = self.tick(**changes)
        return row

    def move(self, position, seconds=0.1):
        """Takes the handle somewhere smoothly and waits there."""
        path = np.linspace(self.position, position, round(seconds / PERIOD) + 1)[1:]
        for self.position in path:
            self.tick()
        return self.run(0.002)

    def tool(self, position, velocity=(0.0, 0.0, 0.0), age=0.001):
        self.inputs |= {"tool_position": position, "tool_velocity": velocity, "tool_age": age, "tool_sequence": 1.0}


def pressing():
    """A servo that presses a wall with 2 N, so deep that it feels the coupling of a tool that comes."""
    runner = Servo(**WALL, **FREE, engage__time=0.1)
    if not abs(runner.move((-0.002, 0.0, 0.0)).motor[0] - 2.0) < 2e-3:
        raise AssertionError("the motor does not press with 2 N")
    return runner


def fault_of(row):
    """Name of a row's fault, "" for none."""
    return faults.name_of(row.fault)


# What a pressing servo is given up to a share of each fault's limit: just below 1 it is no fault.
def _silence(runner, share):
    return [runner.tick(stale=True) for _ in range(round(0.02 * share / PERIOD))][-1]


def _far(runner, share):
    runner.settings["hardware"]["position_low"] = -0.002 / share
    return runner.tick()


def _way(runner, share):
    """In one tick, as a share of what the velocity limit allows."""
    runner.settings["hardware"]["velocity_limit"] = 2.0
    runner.position = runner.position + [2.0 * share * PERIOD, 0.0, 0.0]
    return runner.tick()


def _jump(runner, share):
    return _way(runner, 2.0 * share)


def _hold(runner, share):
    runner.settings["hardware"]["motor_limit"] = 1.9
    return runner.run(1.0 * share)


def _warm(runner, share):
    """Held for ten times the time in which the motor warms up, against this share of what it may."""
    force, limit = runner.rows[-1]["force_on_handle"][0, 0], runner.settings["hardware"]["motor_limit"][0, 0]
    runner.settings["fault"]["duty"] = force / limit / share
    runner.settings["fault"]["duty_kept"] = math.exp(-PERIOD / 0.05)
    return runner.run(0.5)


def _number(runner, share):
    runner.settings["coupling"]["stiffness"] = 1.0
    runner.tool((0.0, 0.0, 0.0))
    runner.run(0.2)
    runner.tool((0.1 if share < 1.0 else math.nan, 0.0, 0.0))
    return runner.tick()


def _stretched(runner, share):
    """Two links in place of x and y; beyond 1 the elbow, which was bent by 0.5 rad, is bent to its other side."""
    settings, place = runner.settings, runner.position[0]
    x, y = kinematics.Kinematics(type="serial_2r", proximal=0.1, distal=0.1).pose(0.0, 0.5)[:2]
    settings["linkage"] = kinematics.SERIAL_2R, 0.0, 0.1, 0.1, 1.0, 0.0, x - place, y
    settings["port"]["joints"] = 2.0
    for elbow in (0.5, math.copysign(0.5, 1.0 - share)):
        settings["hardware"]["zero"][0, :2], runner.memory["motion"]["joint"][0, :2] = (place, -elbow), (0.0, elbow)
        row = runner.tick()
    return row


def _status(bit):
    return lambda runner, share: runner.tick(device_status=faults.FRESH | (faults.CLAMPED if share < 1.0 else bit))


def _command(bit):
    return lambda runner, share: runner.tick(command=enable_state.ENABLE | (bit if share > 1.0 else 0))


class Provoked(NamedTuple):
    """go: (servo, share of the limit) → row; told: pattern of its number; lasts: what each tick is given while its
    cause lasts, None where a cause is over with the force or the motion."""

    go: object
    told: str = ""
    lasts: dict | None = None


ESTOP, UNATTENDED, ENABLE = enable_state.ESTOP, enable_state.UNATTENDED, enable_state.ENABLE
PLACE = r"the handle was at x = −0\.002 m"
PROVOKED = {
    "estop": Provoked(_command(ESTOP), lasts={"command": ESTOP}),
    "device_silent": Provoked(_silence, r"no answer for 0\.0202 s; the limit is 0\.02 s", {"stale": True}),
    "not_a_number": Provoked(_number, "the force of the coupling along x was not a number"),
    "encoder_jump": Provoked(_jump, r"x moved by 0\.00101 m in 0\.25 ms; the limit is 0\.001 m"),
    "position": Provoked(_far, rf"{PLACE}; the workspace ends at −0\.00198 m", {}),
    "velocity": Provoked(_way, r"2\.02 m/s along x; the limit is 2 m/s"),
    "saturation": Provoked(_hold, r"2 N wanted along x for 1 s; the limit is 1\.9 N"),
    "device_watchdog": Provoked(_status(faults.WATCHDOG)),
    "duty": Provoked(_warm, r"a load of [0-9.]+ of the limit of x; fault\.duty is [0-9.]+"),
    "unattended": Provoked(_command(UNATTENDED), r"the limit is 5 s", {"command": UNATTENDED}),
    "device_estop": Provoked(_status(faults.BUTTON), lasts={"device_status": faults.BUTTON}),
    "device_hot": Provoked(_status(faults.HOT), lasts={"device_status": faults.HOT}),
    "device_limit": Provoked(
        _status(faults.END_SWITCH),
        rf"{PLACE}, y = 0 m, theta = 0 rad",
        {"device_status": faults.END_SWITCH, "command": ENABLE},
    ),
    "device_encoder": Provoked(_status(faults.BROKEN_ENCODER), lasts={"device_status": faults.BROKEN_ENCODER}),
    "device_clock": Provoked(_status(faults.CLOCK), lasts={"device_status": faults.CLOCK}),
    "unreachable": Provoked(_stretched, r"the joints were at 0°, −28\.65°"),
}
