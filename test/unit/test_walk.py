# SPDX-License-Identifier: Apache-2.0
"""The way of an encoder count through the simulation and back is short, and the page tells it as it is."""

import sys
from pathlib import Path

from handle_samples import MS, handle

import haptic_sim
from haptic_sim.exchange.endpoint import ExchangeEndpoint
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

PACKAGE = Path(haptic_sim.__file__).parent
PAGE = PACKAGE.parent / "docs/theory/architecture.md"
MOST = 8  # files of haptic_sim, the node's among them


def files_entered(call) -> list[str]:
    """Files of haptic_sim whose functions run in a call, in the order in which they are first entered."""
    entered = {}

    def note(frame, event, argument):
        path = Path(frame.f_code.co_filename)
        if event == "call" and PACKAGE in path.parents:
            entered[f"haptic_sim/{path.relative_to(PACKAGE)}"] = None

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return list(entered)


def test_an_exchange_in_contact_enters_few_files_and_the_page_names_each():
    scene = load("peg_in_hole")
    simulation = Simulation(reduce_scene(scene), max_catch_up=0.5, port=port_of("pspm"))
    end, (x, y, angle) = ExchangeEndpoint(simulation, scene.tool.pose), scene.tool.pose
    down = [handle(float(k), position=(x, y - 1e-3 * k, angle), stamp_ns=k * MS, energy=1.0) for k in range(1, 121)]
    for message in down[:-1]:
        assert end.answer([message], 0) is not None
    assert simulation.counters.max_contact_force > 0.0
    entered = ["haptic_sim/node/simulation.py", *files_entered(lambda: end.answer([down[-1]], 0))]
    assert len(entered) <= MOST, entered
    walk = PAGE.read_text(encoding="utf-8").split("## Walk 2")[1]
    assert [name for name in entered if f"`{name}`" not in walk and f"`{Path(name).name}`" not in walk] == []
