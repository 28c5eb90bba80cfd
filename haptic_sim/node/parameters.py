# SPDX-License-Identifier: Apache-2.0
"""Parameters of haptic_simulation and haptic_relay."""

from typing import Literal

from haptic_device.parameter_types import Group, Watched, fixed, limits_of, live, parameters_of
from haptic_device.parameters import Exchange, ExchangeMethod, Realtime
from haptic_sim.exchange.port_limits import BUDGET, LIMITS
from haptic_sim.method_registry import AUTO, offered


class Method(Group):
    """What a simulation shares of the driver's exchange."""

    method: ExchangeMethod = Exchange.model_fields["method"]


class Simulation(Group):
    """haptic_simulation."""

    autostart: bool = fixed(True, "", "configure and activate by itself at start")
    scene: str = live("peg_in_hole", "", "a scene in config/scenes, or path of a scene file; ~/load_scene loads it")
    method: Literal[(AUTO, *offered())] = live(
        AUTO, "", "simulation method; auto: as the scene asks, or as fits it; ~/load_scene takes it"
    )
    sub_step: float = fixed(0.0, "s", "step of the simulated world; 0: as the scene asks, or as fits it", 0.0, 2e-3)
    max_catch_up: float = fixed(
        0.02,
        "s",
        "gap between handle samples beyond which the world makes up nothing; below, what fits in a period",
        2e-3,
        1.0,
    )
    exchange: Method
    port_budget: float = fixed(BUDGET, "J", "energy the tool port may supply before any was shipped", 0.0, 10.0)
    port_force: float = fixed(LIMITS.force, "N", "largest pull on the tool", 0.1, 1000.0)
    port_torque: float = fixed(LIMITS.torque, "N m", "largest twist on the tool", 0.001, 100.0)
    port_slew: float = fixed(LIMITS.slew, "N/s", "fastest change of the pull by the device's samples", 1.0, 1e6)
    realtime: Realtime = fixed("prefer", "", "real-time scheduling of the thread that answers")
    realtime_priority: int = fixed(60, "", "SCHED_FIFO priority of the thread that answers", 1, 98)


class NetworkEmulator(Group):
    """haptic_relay."""

    autostart: bool = fixed(True, "", "configure and activate by itself at start")
    delay: float = fixed(0.0, "s", "delay of both ways together; either has half of it", 0.0, 2.0)
    jitter: float = fixed(0.0, "s", "uniform ± of the delay of both ways together", 0.0, 2.0)
    loss: float = fixed(0.0, "", "share of the messages lost, either way", 0.0, 1.0)
    duplicates: float = fixed(0.0, "", "share of the messages that come twice", 0.0, 1.0)
    seed: int = fixed(0, "", "seed of the random numbers", 0, 2**31 - 1)


FIGURES = (
    Watched("compute", "s", "answering one handle sample, 99 %", 5e-4, 1e-3),
    Watched("refused", "1/s", "handle messages refused", 1.0, 100.0),
)
PARAMETERS = (*parameters_of(Simulation), *limits_of(FIGURES))
NETWORK_EMULATOR = parameters_of(NetworkEmulator)
