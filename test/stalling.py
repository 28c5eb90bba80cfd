# SPDX-License-Identifier: Apache-2.0
"""Lock-step on a machine that stalls: ticks are missed, at random, and the forces before them held for longer."""

import numpy as np

from haptic_device.config.description import load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import NODES
from haptic_device.device import simulated_device
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import Lockstep, Network
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

SECONDS = 3.0  # of a press, 2 cm through free space before it
NETWORK = Network(1e-3, seed=1)
HAND = {"motion.name": "press_wall", "motion.duration": SECONDS}


class Stalling(Lockstep):
    """After a share of the ticks one to `longest` are missed. As in the live servo those have no row of their own:
    rows of missed ticks repeat the one before, at their own deadline.
    """

    def __init__(self, *given, share, longest, stalls, **named):
        super().__init__(*given, **named)
        self.share, self.longest, self._left, self._last = share, longest, 0, None
        self._stalls = np.random.default_rng(stalls)

    def script_ticks(self, rows, start):
        for k in range(len(rows)):
            if self._left > 0:
                self._left -= 1
                rows[k] = self._last
                rows[k].deadline = start + k * self.period
                continue
            simulated_device.run_lockstep(
                self.settings,
                self.memory,
                rows[k : k + 1],
                self.tool,
                self.plant,
                self.plant_memory,
                self.motion,
                start + k * self.period,
                self.ticks + k,
                self.write_delay,
                self.command,
            )
            self._last = rows[k].copy()
            if self._stalls.random() < self.share:
                self._left = int(self._stalls.integers(1, self.longest + 1))


def pressed(what, of_bound, share, longest, stalls=0, rate=4000.0, control=True, damping=0.5):
    """Energy given to the operator in a press [J], and its rows.

    what: `wall`, of the servo, or an exchange method with the tool at the wall of the scene; of_bound: stiffness in
    what the damping of the desktop device covers, 2 (b − B)/T; the encoder's steps are 10 nm.
    """
    shipped = load_device("desktop")
    device = shipped.model_copy(
        update={"axes": tuple(one.model_copy(update={"counts_per_unit": 1e8}) for one in shipped.axes)}
    )
    values = {node: defaults(declared) for node, declared in NODES.items()}
    stiffness = of_bound * 2.0 * (shipped.axes[0].damping - damping) * rate
    driver = {"servo.rate": rate, "passivity.control": control}
    if what == "wall":
        driver |= {
            "wall.normals": (1.0, 0.0),
            "wall.offsets": (0.0,),
            "wall.stiffness": (stiffness,),
            "wall.damping": (damping,),
            "coupling.stiffness": 0.0,
            "coupling.damping": 0.0,
        }
        hand, simulation = HAND | {"motion.start": (0.02, 0.0, 0.0), "motion.target": (-0.005, 0.0, 0.0)}, None
    else:
        driver |= {"coupling.stiffness": stiffness, "coupling.damping": damping, "exchange.method": what}
        hand = HAND | {"motion.start": (0.03, 0.0, 0.0), "motion.target": (0.005, 0.0, 0.0)}
        simulation = Simulation(reduce_scene(load("wall")), None, 0.5, port=port_of(what))
    system = Stalling(
        device,
        values["haptic_driver"] | driver,
        values["haptic_loopback"] | hand,
        simulation,
        NETWORK,
        share=share,
        longest=longest,
        stalls=stalls,
    )
    rows = system.run(SECONDS)
    return float(system.plant_memory["energy_given"][0]), rows
