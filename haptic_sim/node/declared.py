# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_simulation and haptic_relay."""

from haptic_device.nodes import diagnostics
from haptic_device.parameter import Parameter
from haptic_device.parameters import EXCHANGE
from haptic_sim.port_limits import BUDGET, LIMITS
from haptic_sim.scene import AUTO, METHODS

PARAMETERS = (
    Parameter("autostart", True, "", "configure and activate by itself at start"),
    Parameter(
        "scene",
        "peg_in_hole",
        "",
        "a scene in config/scenes, or path of a scene file; ~/load_scene loads it",
        live=True,
    ),
    Parameter(
        "method",
        AUTO,
        "",
        "simulation method; auto: as the scene asks, or as fits it; ~/load_scene takes it",
        live=True,
        choices=(AUTO, *METHODS),
    ),
    Parameter("sub_step", 0.0, "s", "step of the simulated world; 0: as the scene asks, or as fits it", 0.0, 2e-3),
    Parameter("max_catch_up", 0.02, "s", "gap between handle samples beyond which the world waits", 2e-3, 1.0),
    next(parameter for parameter in EXCHANGE if parameter.name == "exchange.method"),
    Parameter("port_budget", BUDGET, "J", "energy the tool port may supply before any was shipped", 0.0, 10.0),
    Parameter("port_force", LIMITS.force, "N", "largest pull on the tool", 0.1, 1000.0),
    Parameter("port_torque", LIMITS.torque, "N m", "largest twist on the tool", 0.001, 100.0),
    Parameter("port_slew", LIMITS.slew, "N/s", "fastest change of the pull by the device's samples", 1.0, 1e6),
    Parameter(
        "realtime",
        "prefer",
        "",
        "real-time scheduling of the exchange thread",
        choices=("require", "prefer", "off"),
    ),
    Parameter("realtime_priority", 60, "", "SCHED_FIFO priority of the exchange thread", 1, 98),
    *diagnostics.parameters(diagnostics.SIMULATION),
)

RELAY = (
    Parameter("autostart", True, "", "configure and activate by itself at start"),
    Parameter("delay", 0.0, "s", "of both ways together; either has half of it", 0.0, 2.0),
    Parameter("jitter", 0.0, "s", "uniform ± of the delay of both ways together", 0.0, 2.0),
    Parameter("loss", 0.0, "", "share of the messages lost, either way", 0.0, 1.0),
    Parameter("duplicates", 0.0, "", "share of the messages that come twice", 0.0, 1.0),
    Parameter("seed", 0, "", "of the random numbers", 0, 2**31 - 1),
)
