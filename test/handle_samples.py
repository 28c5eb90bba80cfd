# SPDX-License-Identifier: Apache-2.0
"""Handle messages as a driver sends them to the simulation, and a simulation that answers all alike."""

from haptic_device.control import exchange_samples
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.recording.layouts import JointLayout
from haptic_sim.exchange.simulation import Counters, ToolSample

HOME = (0.001, 0.11, 0.02)
GAINS = [2000.0, 2.0, 2.0, 0.002]
MS = 1_000_000  # [ns]
TOOL = ToolSample((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (7.0, 8.0, 9.0), True, 0.25)


class Recording:
    """In place of a Simulation: keeps the handle samples that it was asked with, and counts new time bases."""

    sub_step_ns, counters = MS, Counters()  # it makes none

    def __init__(self, local_contacts=None):
        self.asked, self.rejoined, self.local_contacts = [], 0, local_contacts

    def exchange(self, handle, most=None):
        self.asked.append(handle)
        return TOOL

    def rejoin(self):
        self.rejoined += 1


def handle(sequence=1.0, session=77.0, axes=3, position=HOME, stamp_ns=5_000_000_007, speed=0.5, first="x", **tail):
    """Bytes of a handle message; speed [m/s, rad/s] of each axis; first: name of the first axis."""
    entries = dict.fromkeys(TAIL, 0.0)
    entries.update(layout_version=exchange_samples.LAYOUT_VERSION, session=session, sequence=sequence)
    entries["gains_hash"] = exchange_samples.gains_hash(*GAINS)
    entries["exchange_method"] = float(exchange_samples.PSPM)
    entries.update(zip(TAIL[exchange_samples.GAIN_0 :], GAINS, strict=False))
    entries.update(tail)
    zeros = [0.0] * (axes + len(entries))
    layout = JointLayout((first, *exchange_names(axes)[1:]))
    return layout.pack(stamp_ns, [*position[:axes], *entries.values()], [*[speed] * axes, *zeros[axes:]], zeros)
