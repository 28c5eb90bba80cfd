# SPDX-License-Identifier: Apache-2.0
"""What of the simulation is compiled in advance: each group makes ready what haptic_simulation makes ready."""

from haptic_sim.at_once import compile_for
from haptic_sim.method.registry import make
from haptic_sim.node.declared import PARAMETERS
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation

FREE, JOINTED, IN_CLOSED_FORM = "push_block", "ratchet", "wall"  # a scene of each kind
SUB_STEP = 1e-3  # [s]


def methods():
    """Generalized coordinates; from event to event it is the same kernel."""
    make("partitioned", load(JOINTED), SUB_STEP).energy()


def penalty():
    """Contacts as springs."""
    for method in ("penalty_explicit", "penalty_implicit"):
        make(method, load(JOINTED), SUB_STEP).energy()


def closed_form():
    """A tool among flat walls, and the ports behind which any method stands."""
    from haptic_device.node import wire

    for exchange in ("pspm", "wave"):
        values = {parameter.name: parameter.default for parameter in PARAMETERS} | {"exchange.method": exchange}
        world = Simulation.by_parameters(load(IN_CLOSED_FORM), values)
        compile_for(world, wire.JointLayout(wire.exchange_names(1)))


def local_contacts():
    """What the servo's own tool may touch."""
    for scene in (FREE, JOINTED):
        Simulation(load(scene), method="impulse").local_contacts.look(0.0)


GROUPS = {
    "methods": methods,
    "methods of penalty": penalty,
    "closed form": closed_form,
    "local contacts": local_contacts,
}
