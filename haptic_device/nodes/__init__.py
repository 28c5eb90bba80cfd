# SPDX-License-Identifier: Apache-2.0
"""The nodes, and where their executables begin: they hear signals before what a node needs is imported."""

from functools import partial

from haptic_device.process import start

haptic_bridge = partial(start, "haptic_device.nodes.bridge")
haptic_driver = partial(start, "haptic_device.nodes.driver")
haptic_loopback = partial(start, "haptic_device.nodes.loopback")
haptic_recorder = partial(start, "haptic_device.nodes.recorder")
FIRST_ROW = "the first row has come"  # what haptic_recorder says of each bag; haptic record waits for it
