# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_viewer."""

from haptic_device.parameter_types import Group, fixed, parameters_of

HOME_PORT = 8723


class Viewer(Group):
    """haptic_viewer."""

    host: str = fixed("127.0.0.1", "", "address it listens on; anything but this machine's own is warned of")
    port: int = fixed(HOME_PORT, "", "TCP port; the default goes on to the next free one; 0: any", 0, 65535)
    rate: float = fixed(60.0, "Hz", "frames sent to each page, at most", 1.0, 120.0)
    marker_rate: float = fixed(30.0, "Hz", "markers, while somebody listens", 1.0, 120.0)
    hand_speed: float = fixed(1.0, "m/s", "fastest motion of the hand's target that a page may ask for", 0.01, 3.0)
    hand_turn: float = fixed(15.0, "rad/s", "fastest turn of the hand's target that a page may ask for", 0.1, 60.0)


PARAMETERS = parameters_of(Viewer)
