# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_simulation."""

from haptic_device.parameter import Parameter

PARAMETERS = (
    Parameter("autostart", True, "", "configure and activate by itself at start"),
    Parameter("scene", "peg_in_hole", "", "name of a scene in config/scenes, or path of a scene file"),
    Parameter("sub_step", 0.25e-3, "s", "step of the simulated world", 20e-6, 2e-3),
    Parameter("max_catch_up", 0.02, "s", "gap between handle samples beyond which the world waits", 2e-3, 1.0),
    Parameter(
        "realtime",
        "prefer",
        "",
        "real-time scheduling of the exchange thread",
        choices=("require", "prefer", "off"),
    ),
    Parameter("realtime_priority", 60, "", "SCHED_FIFO priority of the exchange thread", 1, 98),
)
