# SPDX-License-Identifier: Apache-2.0
"""haptic_simulation and haptic_relay, and where the first's executable begins: as those of haptic_device.nodes."""

from functools import partial

from haptic_device.process import start

haptic_simulation = partial(start, "haptic_sim.node.simulation")
