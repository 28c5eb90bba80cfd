# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_viewer."""

from haptic_device.parameter import Parameter

PARAMETERS = (
    Parameter("host", "127.0.0.1", "", "address it listens on; anything but this machine's own is warned of"),
    Parameter("port", 0, "", "TCP port; 0: any that is free", 0, 65535),
    Parameter("rate", 60.0, "Hz", "frames sent to each page, at most", 1.0, 120.0),
    Parameter("marker_rate", 30.0, "Hz", "markers, while somebody listens", 1.0, 120.0),
    Parameter("hand_speed", 1.0, "m/s", "fastest motion of the hand's target that a page may ask for", 0.01, 3.0),
    Parameter("hand_turn", 15.0, "rad/s", "and the fastest turn", 0.1, 60.0),
)
