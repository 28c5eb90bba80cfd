# SPDX-License-Identifier: Apache-2.0
"""The parameters of the simulation's nodes, each declared once, and of all nodes of the package; without ROS."""

from typing import Literal

from haptic_device.config.parameter_types import Group, Watched, fixed, limits_of, live, parameters_of
from haptic_device.config.parameters import NODES as DEVICE_NODES
from haptic_device.config.parameters import Exchange, ExchangeMethod, Realtime
from haptic_sim.exchange import BUDGET, LIMITS
from haptic_sim.method_registry import AUTO, offered

HOME_PORT = 8723


class Method(Group):
    """What a simulation shares of the driver's exchange."""

    method: ExchangeMethod = Exchange.model_fields["method"]


class Simulation(Group):
    """haptic_simulation."""

    autostart: bool = fixed(True, "", "true: the node configures and activates itself")
    scene: str = live("peg_in_hole", "", "name in config/scenes, or path of a scene file; ~/load_scene loads it")
    method: Literal[(AUTO, *offered())] = live(
        AUTO, "", "simulation method; auto: that of the scene, else chosen; takes effect at ~/load_scene"
    )
    sub_step: float = fixed(0.0, "s", "step of the simulated world; 0: that of the scene, else chosen", 0.0, 2e-3)
    max_catch_up: float = fixed(
        0.02, "s", "longest gap between handle samples that the world makes up, as far as a period allows", 2e-3, 1.0
    )
    exchange: Method
    port_budget: float = fixed(BUDGET, "J", "most energy that the tool port supplies before any has come", 0.0, 10.0)
    port_force: float = fixed(LIMITS.force, "N", "largest force of the coupling on the tool", 0.1, 1000.0)
    port_torque: float = fixed(LIMITS.torque, "N m", "largest torque of the coupling on the tool", 0.001, 100.0)
    port_slew: float = fixed(
        LIMITS.slew, "N/s", "fastest change of the force on the tool by handle samples alone", 1.0, 1e6
    )
    realtime: Realtime = fixed("prefer", "", "real-time scheduling of the thread that answers samples")
    realtime_priority: int = fixed(60, "", "SCHED_FIFO priority of the thread that answers samples", 1, 98)


class NetworkEmulator(Group):
    """haptic_relay."""

    autostart: bool = fixed(True, "", "true: the node configures and activates itself")
    delay: float = fixed(0.0, "s", "delay of a round trip; half of it in each direction", 0.0, 2.0)
    jitter: float = fixed(0.0, "s", "uniform jitter (±) of the delay of a round trip", 0.0, 2.0)
    loss: float = fixed(0.0, "", "share of the messages lost in each direction", 0.0, 1.0)
    duplicates: float = fixed(0.0, "", "share of the messages that arrive twice", 0.0, 1.0)
    seed: int = fixed(0, "", "seed of the random numbers", 0, 2**31 - 1)


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


FIGURES = (
    Watched("compute", "s", "time to answer one handle sample, 99 %", 5e-4, 1e-3),
    Watched("refused", "1/s", "handle messages refused", 1.0, 100.0),
)
NODES = {
    **DEVICE_NODES,
    "haptic_simulation": (*parameters_of(Simulation), *limits_of(FIGURES)),
    "haptic_relay": parameters_of(NetworkEmulator),
    "haptic_viewer": parameters_of(Viewer),
}
