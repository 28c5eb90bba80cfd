# SPDX-License-Identifier: Apache-2.0
"""The tool in the servo on live nodes: sets come over DDS, are taken and felt; without them set-position modulation."""

import threading

import pytest
from live_nodes import Ear, Nodes

from haptic_device.node import wire
from haptic_sim.cli.local_felt import SHARE, measure

pytestmark = pytest.mark.live

RATE, BUDGET = 4000.0, 0.005  # [Hz], [J]
OUT, IN = 0.02, 0.005  # [m] of the hand; the wall's tool touches at 0.01
KICK = 1.0  # [N] in 10 ms
LATE = 48  # ticks of the 24000, a fifth of a per cent, whose forces were held for longer than the law knew


def undisturbed():
    """The first of four measurements in which the machine did not stand still; none gives energy beyond the budget."""
    said = []
    while len(said) < 4:
        try:
            felt = measure(RATE, "local", live=True)
        except ValueError as error:
            assert "device_watchdog" in str(error)
            said.append(str(error))
            continue
        assert felt.given <= BUDGET
        if felt.local == 1.0 and felt.missed < LATE:
            return felt
        said.append(f"{felt.missed} ticks missed, own tool {felt.local:.1%} of the time")
    pytest.fail(f"the machine stood still: {'; '.join(said)}")


@pytest.mark.timeout(300)
def test_a_wall_is_as_stiff_as_the_coupling_and_free_space_as_free_as_the_tool_is_light(ros_domain):
    local = undisturbed()
    assert local.sets > 1000
    assert local.coupling == pytest.approx(SHARE * 2.0 * (3.0 - 0.5) * RATE)
    assert local.stiffness == pytest.approx(local.coupling, rel=0.05)
    assert abs(local.drag) <= 0.05 * local.coupling * local.age
    assert local.mass == pytest.approx(0.1, rel=0.05)


@pytest.fixture
def carrier(ros_domain, tmp_path):
    """An ear that carries the sets from the simulation to the driver while `carrying` is set."""
    ear, carrying = Ear(ros_domain), threading.Event()
    publisher = ear.node.create_publisher(wire.PointCloud2, "local_contacts", wire.LATEST)
    ear.node.create_subscription(
        wire.PointCloud2, "far_local_contacts", lambda data: publisher.publish(data) if carrying.is_set() else None,
        wire.LATEST, raw=True,
    )  # fmt: skip
    with Nodes(tmp_path) as nodes:
        nodes.start("haptic_loopback", motion__name="follow", motion__start=(OUT, 0.0, 0.0))
        nodes.start("haptic_simulation", scene="wall", exchange__method="local",
                    renamed=("local_contacts:=far_local_contacts",))
        nodes.start("haptic_driver", exchange__method="local", coupling__stiffness=2000.0, coupling__damping=2.0,
                    auto_enable=True)  # fmt: skip
        carrying.set()
        yield ear, carrying
    ear.close()


def test_where_sets_stop_modulation_takes_over_without_a_kick_is_counted_and_gives_way_when_they_come_again(carrier):
    ear, carrying = carrier

    def said(condition):
        return ear.news("haptic_driver", lambda level, message, values: values.get("local") and condition(values))[2]

    said(lambda values: values["local"] == "acts")
    ear.go_to(IN)
    pressed = said(lambda values: values["local"] == "acts" and int(values["local_sets"]) > 100)
    assert pressed["local_fallbacks"] == "0" and 0.0 <= float(pressed["tools_apart_mm"]) <= 5.0
    begin = len(ear.truths)
    carrying.clear()
    alone = said(lambda values: values["local"] != "acts")
    assert alone["local_fallbacks"] == "1" and alone["fault"] == ""
    carrying.set()
    again = said(lambda values: values["local"] == "acts")
    assert again["local_fallbacks"] == "1" and int(again["local_sets"]) > int(alone["local_sets"])
    force = [float(ear.motor(truth)[0]) for truth in ear.truths[begin:]]
    assert min(force) > 1.0 and max(abs(b - a) for a, b in zip(force, force[1:], strict=False)) < KICK
    assert max(truth.position[2 * ear.axes] for truth in ear.truths) <= BUDGET
