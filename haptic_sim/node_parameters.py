# SPDX-License-Identifier: Apache-2.0
"""The parameter declarations of every node of the package, gathered without importing ROS."""

from haptic_device import parameters as device
from haptic_sim.node import parameters as simulation
from haptic_sim.viewer import parameters as viewer

NODES = {
    **device.NODES,
    "haptic_simulation": simulation.PARAMETERS,
    "haptic_relay": simulation.NETWORK_EMULATOR,
    "haptic_viewer": viewer.PARAMETERS,
}
