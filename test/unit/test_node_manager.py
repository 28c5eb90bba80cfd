# SPDX-License-Identifier: Apache-2.0
"""Nodes that are started again for another exchange or network: what they are started with. No node runs."""

import asyncio
import threading
from pathlib import Path

import pytest

from haptic_display.page.node_manager import HAND, NETWORK, NodeManager
from haptic_display.run.system import Order

POINT = Path(__file__).parents[1] / "busy.yaml"
DRIVER, SIMULATION = "haptic_driver", "haptic_simulation"


class Nodes:
    """Keeps the programs that were started since the last end."""

    def __init__(self):
        self.started = {}

    def start(self, program):
        self.started[program.name] = program.parameters

    def end_all_but(self, kept):
        self.started = {}

    def kill(self, name):
        self.killer = threading.current_thread()


@pytest.fixture
def manager(tmp_path):
    manager = NodeManager(Order("peg_in_hole", None, tmp_path, None, None, POINT, given=HAND), nodes := Nodes())
    manager.start()
    manager.started_with = lambda: nodes.started
    return manager


def changed(manager, name, value, enable=True):
    asyncio.run(manager.change(name, value, enable))
    return manager.started_with()


WALLS = {"wall.normals": [0.0, 1.0], "wall.offsets": [-0.05], "wall.stiffness": [300.0], "wall.damping": [0.0]}


def test_another_exchange_keeps_scene_method_and_everything_that_was_changed_while_the_nodes_ran(manager):
    live = {"coupling.stiffness": 700.0, "servo.rate": 1000.0, **WALLS}
    manager.keep({DRIVER: live, SIMULATION: {"scene": "wrench_on_nut", "method": "partitioned"}})
    started = changed(manager, "exchange.method", "direct")
    assert started[DRIVER]["exchange.method"] == started[SIMULATION]["exchange.method"] == "direct"
    assert started[DRIVER].items() >= {"coupling.stiffness": 700.0, **WALLS}.items()
    assert Path(started[SIMULATION]["scene"]).stem == "wrench_on_nut"
    assert started[SIMULATION]["method"] == "partitioned"
    manager.keep({DRIVER: dict.fromkeys(WALLS, [])})
    taken = changed(manager, "delay", 5.0)[DRIVER]
    assert taken.items() >= dict.fromkeys(WALLS, []).items(), "walls that were taken away do not come back"
    assert "servo.rate" not in started[DRIVER], "what is fixed is said by the operating point as before"


@pytest.mark.parametrize("name", NETWORK)
def test_a_delay_is_taken_up_to_what_can_be_felt(manager, name):
    assert manager.offer()[name]["high"] == 200.0
    changed(manager, name, 200)
    assert manager.offer()[name]["value"] == pytest.approx(200.0)
    with pytest.raises(ValueError, match=rf"{name} is 200.1; 0 to 200.0 ms is needed"):
        changed(manager, name, 200.1)


def test_a_driver_that_is_started_again_enables_itself_only_if_it_may_and_holds_up_nobody_while_it_is_killed(manager):
    for enable in (True, False, True):
        assert changed(manager, "delay", 5.0, enable)[DRIVER]["auto_enable"] is enable
    asyncio.run(manager.start_again([DRIVER]))
    assert manager._nodes.started[DRIVER]["auto_enable"] is False
    assert manager._nodes.killer is not threading.main_thread()
