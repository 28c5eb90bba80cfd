# SPDX-License-Identifier: Apache-2.0
"""What is compared is the same problem for every peer."""

import pytest

from bench.methods import world
from bench.methods.measure import run
from bench.reference.case import case
from bench.reference.reference import reference
from haptic_sim.lockstep.error_metrics import STABLE

PACKAGES = {"box2d": "pyb2d3", "mujoco_rk4": "mujoco", "mujoco_implicit": "mujoco"}  # of the peers that are optional


@pytest.mark.parametrize("peer", world.PEERS)
@pytest.mark.parametrize("name", ["free_space", "pendulum", "four_bar", "slider", "wall"])
def test_every_peer_comes_to_the_closed_form(peer, name):
    """So that what is compared is the same problem: signs, anchors, masses, coupling, hand."""
    pytest.importorskip(PACKAGES.get(peer, "pymunk"))
    found = run(case(name), reference(name), peer, 250)
    assert found.status == STABLE
    assert found.error < 2e-3
