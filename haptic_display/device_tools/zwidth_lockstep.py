# SPDX-License-Identifier: Apache-2.0
"""The display of `haptic zwidth --live` in lock-step: same device, hand, gestures and judgement, no clock, no DDS."""

import numpy as np

from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import OPERATING_POINT, OPERATOR
from haptic_device.control import controller_config, enable_state, gain_check, records
from haptic_device.device import loopback_config, operator_hand, plant, simulated_device
from haptic_device.realtime import servo_loop
from haptic_device.theory import probe

HAND = {"mass": 0.05, "damping": 0.5, "stiffness": 100.0}  # light: it calms little
OUT, DEPTH, RADIUS = 0.005, 0.02, 0.02  # [m] of the gestures; pressed in by 2 N
WALL = -0.02  # [m] offset of the wall on x; the hand comes from above
PHASES = (1.0, 0.97, 1.03, 0.9, 1.1)  # of the depth: one touch each, live too
EVERY = 0.002  # [s] between two targets of the hand
LAG = 0.01  # [s] motion.lag


class LockstepDisplay:
    """A display in lock-step; `show` and `turn` as of the live one. write_delay [s]: of the servo's writes."""

    def __init__(self, device, rate, damping, write_delay=0.0):
        self.device, self.damping, self.delay = device, damping, int(write_delay * 1e9)
        self.values = defaults(OPERATING_POINT)
        self.values |= {"servo.rate": rate, "coupling.stiffness": 0.0, "coupling.damping": 0.0}
        self.values |= {"passivity.control": False}
        self.period = round(1e9 / rate)

    def show(self, stiffness):
        """Whether the wall of this stiffness shakes under a tap and a press, or even stops the servo by a fault.

        Friction calms small oscillations, so what one gesture shows depends on its phase: the worst of some counts, as
        jitter finds it on the live display.
        """
        return any(self._touch(stiffness, share * DEPTH) for share in PHASES)

    def _touch(self, stiffness, depth):
        wall = {"wall.normals": (1.0, 0.0), "wall.offsets": (WALL,)}
        wall |= {"wall.stiffness": (stiffness,), "wall.damping": (self.damping,)}
        truth, fault = self._play(
            wall, probe.GESTURE, lambda t: (WALL + probe.tap_and_press(t, OUT, depth), 0.0), WALL + OUT
        )
        return fault or probe.shakes(truth, 0.0, 1.0 / self.device.axes[0].counts_per_unit)

    def turn(self, ratio):
        """Apparent damping on a circle with this share of damping cancelled [N s/m]."""
        truth, _ = self._play({"cancellation.ratio": ratio}, probe.CIRCLE, lambda t: probe.circle(t, RADIUS))
        return probe.apparent_damping(truth, 0.0)

    def _play(self, values, seconds, aim, start=0.0):
        """Truth and whether a fault latched, the handle beginning at rest at x = start [m]."""
        settings = controller_config.settings_from(self.device, self.values | values)
        lateness = gain_check.delays(settings[0]) + self.delay * 1e-9
        settings = gain_check.counted(settings, lateness).view(np.recarray)
        memory = np.zeros(1, records.STATE).view(np.recarray)
        memory.enable.state, memory.enable.ramp = enable_state.ENGAGED, 1.0
        body, state = self._body(start)
        motion = operator_hand.script(defaults(OPERATOR) | {"motion.name": "follow"})
        motion, tool = motion.view(np.recarray), np.zeros(1, servo_loop.TOOL).view(np.recarray)
        ticks = max(1, round(EVERY * 1e9 / self.period))
        rows, samples = np.zeros(ticks, records.TRACE_ROW).view(np.recarray), []
        for first in range(0, round(seconds * 1e9 / self.period), ticks):
            motion.points[0, 0, :2] = aim(first * self.period * 1e-9)
            told = first * self.period, first, self.delay, enable_state.ENABLE
            simulated_device.run_lockstep(settings, memory, rows, tool, body, state, motion, *told)
            samples.append(_sample(state))
            if rows.fault[-1]:
                return probe.GroundTruth(*np.array(samples).T), True
        return probe.GroundTruth(*np.array(samples).T), False

    def _body(self, start):
        body = loopback_config.plant_of(self.device).view(np.recarray)
        state = np.zeros(1, plant.PLANT_MEMORY).view(np.recarray)
        for name, value in HAND.items():
            body[f"hand_{name}"][0, :2] = value
        state.position[0, 0] = state.target[0, 0] = start
        return body, state


def _sample(state):
    s = state[0]
    return s.time * 1e-9, s.position[0], s.velocity[0], s.velocity[1], s.energy_given
