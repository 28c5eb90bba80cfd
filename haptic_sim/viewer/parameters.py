# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_viewer."""

from haptic_device.parameter_types import Group, fixed, parameters_of

HOME_PORT = 8723


class Viewer(Group):
    """haptic_viewer."""

    host: str = fixed("127.0.0.1", "", "address of the web server; a warning if other machines can reach it")
    port: int = fixed(HOME_PORT, "", "TCP port; if the default is in use, the next free one; 0: any", 0, 65535)
    rate: float = fixed(60.0, "Hz", "largest number of frames per second to each page", 1.0, 120.0)
    marker_rate: float = fixed(30.0, "Hz", "messages per second on markers, while there is a subscriber", 1.0, 120.0)
    hand_speed: float = fixed(1.0, "m/s", "largest speed of the hand's target that a page may set", 0.01, 3.0)
    hand_turn: float = fixed(
        15.0, "rad/s", "largest rotation speed of the hand's target that a page may set", 0.1, 60.0
    )


PARAMETERS = parameters_of(Viewer)
