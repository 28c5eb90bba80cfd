# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_simulation."""

from haptic_device.law.exchange import PARAMETERS as EXCHANGE
from haptic_device.parameter import Parameter
from haptic_sim.tool_port import BUDGET

PARAMETERS = (
    Parameter("autostart", True, "", "configure and activate by itself at start"),
    Parameter("scene", "peg_in_hole", "", "name of a scene in config/scenes, or path of a scene file"),
    Parameter("sub_step", 0.25e-3, "s", "step of the simulated world", 20e-6, 2e-3),
    Parameter("max_catch_up", 0.02, "s", "gap between handle samples beyond which the world waits", 2e-3, 1.0),
    next(parameter for parameter in EXCHANGE if parameter.name == "exchange.method"),
    Parameter("port_budget", BUDGET, "J", "energy the tool port may supply before any was shipped", 0.0, 10.0),
    Parameter(
        "realtime",
        "prefer",
        "",
        "real-time scheduling of the exchange thread",
        choices=("require", "prefer", "off"),
    ),
    Parameter("realtime_priority", 60, "", "SCHED_FIFO priority of the exchange thread", 1, 98),
)
