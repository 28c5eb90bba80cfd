# SPDX-License-Identifier: Apache-2.0
"""A rigid wall on live nodes behind 20 ± 10 ms and 10 % loss: it is felt, and no energy comes of it.

How steady and stiff it is, and what `direct` gives in its place, is judged in lock-step (test_exchange_passive.py).
"""

import pytest
from live_nodes import Ear, Nodes

from haptic_sim.cli.demo import FAR
from haptic_sim.cli.processes import Program

pytestmark = pytest.mark.timeout(600)

OUT, IN = 0.02, 0.005  # [m] of the hand; the wall's tool touches at 0.01
PRESSED, BUDGET = 1.0, 0.005  # [N], [J]
NETWORK = {"delay": 0.02, "jitter": 0.01, "loss": 0.1}
GAINS = {
    "coupling__stiffness": 2000.0, "coupling__damping": 2.0,
    "coupling__rotational_stiffness": 2.0, "coupling__rotational_damping": 0.002,
}  # fmt: skip


@pytest.fixture
def ear(ros_domain, start, tmp_path):
    """An ear and a hand; the nodes, with a relay between driver and simulation."""
    ear = Ear(ros_domain)
    start(Program("haptic_relay", "haptic_sim.node.relay", NETWORK).command())
    with Nodes(tmp_path) as nodes:
        nodes.start("haptic_loopback", motion__name="follow", motion__start=(OUT, 0.0, 0.0))
        nodes.start("haptic_simulation", scene="wall", renamed=[f"{near}:={far}" for near, far in FAR.items()])
        nodes.start("haptic_driver", **GAINS)
        yield ear
    ear.close()


def test_a_wall_behind_a_bad_network_is_felt_and_gives_no_energy_beyond_the_budget(ear):
    ear.news("haptic_driver", lambda level, message, values: int(values["exchange_answered"]) > 0, what="an answer")
    ear.engaged()
    ear.go_to(OUT)
    begin = len(ear.truths)
    ear.go_to(IN)

    def felt():
        pushes = (ear.motor(truth)[0] > PRESSED for truth in ear.truths[begin:])
        return sum(pushes) > 500  # of truths, 500 of which are a second of the plant's

    ear.until(felt, "the wall pushes the hand for a while")
    values = ear.news("haptic_driver", lambda *said: True)[2]
    assert 0 < int(values["exchange_answered"]) < 0.95 * int(values["exchange_sent"])  # a tenth is lost either way
    assert max(truth.position[2 * ear.axes] for truth in ear.truths) <= BUDGET
