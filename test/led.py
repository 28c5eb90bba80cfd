# SPDX-License-Identifier: Apache-2.0
"""A servo whose handle a test leads from sample to sample, and what the hand is given by it."""

import numpy as np
from ticks import tick

from haptic_device.control import enable_state, faults, records


class Led:
    """Engaged and at rest at the origin, which settings of these are to come to within a few ticks.

    tool: where one stands [m]. given: energy [J] that the hand got at most, from the forces held and less what the
    device's damper took for certain; most: the largest that this ever was; least: of `free`, what was shipped with it.
    """

    def __init__(self, settings, tool=None, ticks=4):
        self.settings, self.tool, self.period = settings, tool, float(settings["period"][0])
        self.damping, self.counts = settings["hardware"]["damping"][0], settings["hardware"]["position_per_count"][0]
        self.memory, self.row = np.zeros(1, records.STATE), np.zeros(1, records.TRACE_ROW).view(np.recarray)
        self.place, self.time, self.ticks, self.given, self.most = np.zeros(3), 1e12, 0, 0.0, 0.0
        self.least, self.forces = np.inf, []
        for k in range(ticks):
            self.go((0.0, 0.0), command=enable_state.ENABLE if k else 0)
        self.forces.clear()

    def go(self, place, periods=1.0, command=enable_state.ENABLE, fault=faults.NONE, shift=0.0, **inputs):
        """Leads the handle there in one hold of so many periods; the force from then on [N, N, N m].

        shift: periods by which the sample's stamp is wrong.
        """
        row, to = self.row[0], np.zeros(3)
        to[: len(place)] = place
        steps = np.divide(to, self.counts, out=np.zeros(3), where=self.counts != 0.0)
        to, self.ticks = np.round(steps) * self.counts, self.ticks + 1
        way, self.time = to - self.place, self.time + periods * self.period * 1e9
        self.given += float(row.force_on_handle @ way - self.damping @ way**2 / (periods * self.period))
        self.most, self.place = max(self.most, self.given), to
        stamp = self.time + shift * self.period * 1e9
        told = {"deadline": self.time, "latched": stamp, "command": command, "device_status": faults.FRESH}
        told |= {"counts": np.round(steps), "tool_age": -1.0}
        if self.tool is not None:
            there = np.zeros(3)
            there[: len(self.tool)] = self.tool
            told |= {"tool_session": 1.0, "tool_sequence": self.ticks, "tool_answered": self.ticks}
            told |= {"tool_age": 0.001, "tool_position": there}
        for name, value in (told | inputs).items():
            row[name] = value
        tick(self.settings, self.memory, self.row)
        if row.fault != fault:
            raise AssertionError(f"fault {row.fault:g}")
        self.least = min(self.least, self.free)
        self.forces.append(row.force_on_handle.copy())
        return self.forces[-1]

    def follow(self, places):
        for place in places:
            self.go(place)
        return self

    @property
    def free(self):
        """What is in the account [J], and what of it was shipped."""
        exchange = self.memory["exchange"][0]
        return float(self.row.exchange_tank[0] + exchange["shipped"] - exchange["returned"])

    @property
    def missing(self):
        """What the account says that the hand may have been given [J]."""
        return float(self.settings["exchange"]["budget"][0] - self.free - self.row.stored[0] - self.row.promised[0])


def store(stiffness, limit, stretch):
    """Energy in a spring that is held at a limit [J]."""
    force = min(stiffness * abs(stretch), limit)
    return force * (abs(stretch) - 0.5 * force / stiffness)


def line(start, end, ticks=100):
    return [np.array(start) + (np.array(end) - np.array(start)) * k / ticks for k in range(1, ticks + 1)]
