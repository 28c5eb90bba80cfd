# SPDX-License-Identifier: Apache-2.0
"""Handle messages as a driver sends them to the simulation."""

from haptic_device.control import exchange_samples
from haptic_device.message_fields import TAIL, exchange_names
from haptic_device.recording.layouts import JointLayout

HOME = (0.001, 0.11, 0.02)
GAINS = [2000.0, 2.0, 2.0, 0.002]
MS = 1_000_000  # [ns]


def handle(sequence=1.0, session=77.0, axes=3, position=HOME, stamp_ns=5_000_000_007, speed=0.5, **tail):
    """Bytes of a handle message; speed [m/s, rad/s] of each axis."""
    entries = dict.fromkeys(TAIL, 0.0)
    entries.update(layout_version=exchange_samples.LAYOUT_VERSION, session=session, sequence=sequence)
    entries["gains_hash"] = exchange_samples.gains_hash(*GAINS)
    entries["exchange_method"] = float(exchange_samples.PSPM)
    entries.update(zip(TAIL[exchange_samples.GAIN_0 :], GAINS, strict=False))
    entries.update(tail)
    zeros = [0.0] * (axes + len(entries))
    layout = JointLayout(exchange_names(axes))
    return layout.pack(stamp_ns, [*position[:axes], *entries.values()], [*[speed] * axes, *zeros[axes:]], zeros)
