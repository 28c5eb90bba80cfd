# SPDX-License-Identifier: Apache-2.0
"""The tool in the servo: free and light, stiff at a wall whatever the network does, and never above its budget.

What a simulation packs of its contacts the driver takes, once, and only if it belongs to its tool.
"""

import math
import random

import numpy as np
import pytest
from examples import searching
from exchange_systems import demo_system, one_axis
from handle_samples import HOME, Recording, handle

from adversary import exchange_search as adversary
from adversary.worst_paths import worst
from bench.exchange import motion
from bench.exchange.felt import FINE, compare
from fault_injection.flood import mutated
from haptic_device.control import contact_model, exchange_samples
from haptic_device.message_fields import COMMON, EACH, LOCAL_CONTACT, MOST
from haptic_device.realtime import exchange_step, seqlock, tick_replay
from haptic_device.recording.layouts import CloudLayout
from haptic_device.recording.writer import Bag
from haptic_display.cli.replay import replay
from haptic_sim.exchange.endpoint import ExchangeEndpoint
from haptic_sim.lockstep.lockstep import Network
from haptic_sim.scene.language import load, parse
from haptic_sim.scene.shapes import Material

BUDGET = 0.005  # [J]
PRESS = {"start": (0.03, 0.0, 0.0), "target": (0.005, 0.0, 0.0), "duration": 1.5}


# two corners of each of nine meet the tool's face at once
TILES = [{"box": {"size": [0.01, 0.004], "center": [-0.005, 0.004 * k]}} for k in range(-4, 5)]
TILES = {"name": "tiles", "bodies": [{"name": "wall", "fixed": True, "shapes": TILES}]}
TILES["tool"] = {"mass": 0.1, "pose": [0.03, 0.0, 0.0], "shapes": [{"box": {"size": [0.02, 0.04]}}]}
TILES = parse(TILES | {"motion": {"name": "press_wall", **PRESS}}, "tiles")


def pressed(network, **given):
    system = demo_system("local", "wall", network, PRESS, **given)
    return system.run(1.5), system


@pytest.fixture(scope="module")
def near():
    return pressed(Network(1e-3))


def test_the_servos_tool_acts_once_the_forces_have_risen_and_never_falls_back(near):
    rows, _ = near
    assert rows.local[-1] == 1.0 and rows.local_fallbacks[-1] == 0.0 and rows.local_stays[-1] == 0.0


def test_a_wall_is_as_stiff_as_the_coupling_and_no_energy_is_given(near):
    rows, system = near
    end = rows[-200:]
    felt = end.force_coupling[:, 0].mean() / (0.01 - end.position[:, 0].mean())
    assert 0.99 * 2000.0 < felt <= 2000.0
    assert system.plant_memory["energy_given"][0] <= BUDGET


def test_the_force_balances_the_copys_momentum_in_every_free_tick(near):
    rows, _ = near
    free = np.flatnonzero((rows.local > 0.0) & (rows.coupling_position[:, 0] > 0.0105))
    free = free[(free > 0) & (rows.local[free - 1] > 0.0)]
    gained = 0.1 * (rows.coupling_velocity[free, 0] - rows.coupling_velocity[free - 1, 0]) / 250e-6
    np.testing.assert_allclose(gained, -rows.force_coupling[free, 0], atol=1e-9)


@pytest.mark.parametrize("network, rate", [(Network(0.02, 0.0, 0.1, 1), 1000.0), (Network(1e-3), 100.0)])
def test_late_lost_or_rare_messages_change_nothing_at_a_wall_that_stands(near, network, rate):
    rows, _ = pressed(network, exchange__rate=rate)
    ended, known = rows[-200:], near[0][-200:]
    assert rows.local[-1] == 1.0
    assert ended.force_coupling[:, 0].mean() == pytest.approx(known.force_coupling[:, 0].mean(), rel=0.01)


def test_contacts_that_are_too_old_give_way_to_set_position_modulation_without_a_kick_and_come_back(near):
    system = demo_system("local", "wall", Network(1e-3), PRESS, local__hold=0.005)
    system.run(1.2)
    system.network = Network(1e-3, 0.0, 1.0)
    lost = system.run(0.03)
    assert lost.local[-1] == 0.0 and lost.local_fallbacks[-1] == 1.0
    assert np.abs(np.diff(lost.force_coupling[:, 0])).max() < 0.2  # [N] of a force of some, in a tick
    system.network = Network(1e-3)
    again = system.run(0.2)
    assert again.local[-1] == 1.0 and np.abs(np.diff(again.force_coupling[:, 0])).max() < 0.2


@pytest.mark.parametrize("cut", [False, True])
def test_where_more_corners_meet_than_a_set_holds_modulation_takes_over_without_a_kick(cut):
    """Also where nothing was heard since the tool was on its way there: the copy has left what it may trust."""
    system = demo_system("local", TILES, Network(1e-3), PRESS, local__hold=2.0, exchange__hold=2.0, local__apart=1.0)
    assert system.run(0.6).local[-1] == 1.0
    if cut:
        system.network = Network(1e-3, 0.0, 1.0)
    rows = system.run(0.7)
    assert rows.local[0] == 1.0 and rows.local[-1] == 0.0 and rows.local_fallbacks[-1] == 1.0
    assert np.abs(np.diff(rows.force_coupling[:, 0])).max() < 0.2  # [N] in a tick
    assert system.plant_memory["energy_given"][0] <= BUDGET


def test_beyond_how_far_the_tools_may_be_apart_modulation_takes_over():
    """A block pushed 20 ms away: the simulation's tool is elsewhere whenever the block speeds up."""
    most = 1e-3
    free, held = (demo_system("local", "push_block", Network(0.02), local__apart=one).run(1.2) for one in (5e-3, most))
    beyond_free, beyond = (np.count_nonzero(rows.tools_apart[rows.local > 0.0] > most) for rows in (free, held))
    assert free.local_fallbacks[-1] == 0.0 and free.tools_apart.max() <= 5e-3
    assert beyond_free > 0.03 * np.count_nonzero(free.local)
    assert 1.0 <= held.local_fallbacks[-1] <= beyond <= 2.0 * held.local_fallbacks[-1]  # ticks to find it


@pytest.mark.parametrize(
    "scene, network", [("peg_in_hole", "20 ms, 10 % lost"), *([("wrench_on_nut", "1 kHz")] if searching() else [])]
)
def test_a_task_is_felt_as_with_the_world_in_the_same_tick(scene, network):
    found = compare(scene, network)
    assert found["tool"] <= 0.05e-3 and found["mean"] == pytest.approx(1.0, abs=0.02)
    assert found["fallbacks"] == 0 and found["local"] > 0.98 and found["given"] <= BUDGET


@pytest.mark.parametrize(
    "axis, velocity",
    [
        (FINE, {}),
        (None, {"velocity.estimator": "lowpass"}),
        (None, {"velocity.estimator": "adaptive_window", "coupling.damping": 1.0}),
    ][: 3 if searching() else 1],
)
def test_a_peg_with_50_um_of_play_goes_in_without_chatter_if_velocity_is_finer_than_a_step_in_a_tick(
    axis, velocity, monkeypatch
):
    point = motion.operating_point()
    point = point | {"haptic_driver": point["haptic_driver"] | velocity}
    monkeypatch.setattr(motion, "operating_point", lambda params: point)
    scene, wider = load("peg_in_hole"), 0.5 * (5e-5 - 2e-4)
    hole = scene.bodies[0]

    def narrowed(shape):
        if shape.key != "vertices":
            return shape
        place = [(x + wider * math.copysign(1.0, x) if abs(x) < 0.05 else x, y) for x, y in shape.vertices]
        return shape.model_copy(update={"vertices": tuple(place)})

    hole = hole.model_copy(update={"shapes": tuple(map(narrowed, hole.shapes))})
    assert hole.shapes[0].vertices[1][0] == pytest.approx(-0.010025)
    found = compare(scene.model_copy(update={"bodies": (hole,)}), "1 kHz", axis=axis)
    assert found["rough"] <= 0.02 and found["tool"] <= 0.05e-3 and found["fallbacks"] == 0


def test_a_wall_that_throws_the_tool_back_is_felt_as_with_the_world_in_the_same_tick():
    scene = load("wall")
    stone = {"stone": Material(restitution=0.5)}
    bodies = tuple(body.model_copy(update={"material": "stone"}) for body in scene.bodies)
    tool = scene.tool.model_copy(update={"material": "stone"})
    motion = {"name": "tap", "start": [0.03, 0.0, 0.0], "target": [0.005, 0.0, 0.0], "duration": 2.0, "taps": 4}
    found = compare(
        scene.model_copy(update={"materials": stone, "bodies": bodies, "tool": tool, "motion": motion}), "3 ms"
    )
    assert found["tool"] <= 0.05e-3 and found["force"] <= 0.01 and found["fallbacks"] == 0


@pytest.mark.parametrize("mass, delay", [(0.3, 1e-3), (0.03, 3e-3), *([(0.1, 3e-3)] if searching() else [])])
def test_what_the_hand_loses_in_an_impact_the_other_body_has_within_a_hundredth(mass, delay):
    """A free block is struck, pushed and let go by a handle that brakes: its momentum is the copy's impulse."""
    scene = load("push_block")
    smooth = {name: material.model_copy(update={"friction": 0.0}) for name, material in scene.materials.items()}
    block = scene.bodies[1].model_copy(update={"pose": (0.0, 0.015, 0.0), "mass": mass})
    free = scene.model_copy(update={"gravity": (0.0, 0.0), "bodies": (block,), "materials": smooth, "measure": {}})
    motion = {"start": (-0.05, 0.015, 0.0), "target": (0.02, 0.015, 0.0), "duration": 0.91}
    system = demo_system("local", free, Network(delay), motion)
    rows = system.run(1.5)
    acted = slice(int(np.flatnonzero(rows.local > 0.0)[0]), None)
    pulled = -rows.force_coupling[acted, 0].sum() * 250e-6
    gained = 0.1 * (rows.coupling_velocity[-1, 0] - rows.coupling_velocity[acted][0, 0])
    has = mass * system.simulation.method.bodies()[1][1][0]
    assert rows.local_fallbacks[-1] == 0.0 and has > 0.15 * mass
    assert pulled - gained == pytest.approx(has, rel=0.01)


@pytest.mark.parametrize("seed, loss, limit", [(1, 0.0, 20.0), (2, 0.3, 20.0), (3, 0.3, 2.0)])
def test_no_message_draws_more_than_the_budget(seed, loss, limit):
    given, against = one_axis("local", force__limit=limit), adversary.Adversary(loss=loss)
    found = worst(f"local {loss:g} {limit:g}", given, against, 400, seed)
    assert found.energy <= BUDGET


def test_the_books_never_credit_what_contacts_said_beyond_the_truth():
    found = worst("local books", one_axis("local"), adversary.Adversary(books=1, full=1), 400, 5)
    assert found.overcredit <= 1e-9


def points_of(sets):
    """What `local_contacts` carries of these sets."""
    points = np.zeros((len(sets), MOST), LOCAL_CONTACT)
    for name in COMMON:
        points[name] = sets[name][:, None]
    for place, name in enumerate(EACH):
        points[name] = sets["table"][:, :, place]
    points["answered"] = sets["number"][:, None]
    return points.ravel()


def written(folder, **topics):
    """A bag with one message of each topic's records."""
    bag = Bag(folder)
    for topic, rows in topics.items():
        channel = bag.add_topic(f"/haptic/{topic}", "sensor_msgs/msg/PointCloud2", [])
        bag.write(channel, CloudLayout(rows.dtype).pack(0, rows), 1, 1, 1)
    bag.close({})
    return folder


def test_the_ticks_of_a_bag_are_computed_again_with_the_contacts_in_it_and_not_without(tmp_path, capsys):
    system = demo_system("local", "wall", Network(1e-3), PRESS)
    topics = {"snapshot": tick_replay.snapshot_of(-1, system.settings[0], system.memory[0])}
    rows, sets = zip(*((system.run(250e-6), system.near.copy()) for _ in range(4000)), strict=True)
    topics["trace"] = np.concatenate(rows)
    assert topics["trace"]["local"][-1] == 1.0 and topics["trace"]["force_coupling"][-1, 0] > 1.0
    replay(written(tmp_path / "whole", **topics, local_contacts=points_of(np.concatenate(sets))), check=True)
    assert capsys.readouterr().out == "4000 ticks computed again are bit-identical\n"
    with pytest.raises(ValueError, match="ticks differ"):
        replay(written(tmp_path / "bare", **topics), check=True)


SESSION, OTHER, PEER = 7.0, 9.0, 5.0
SAID = {"offered": 1.0, "trust": 0.5, "mass": 0.1, "inertia": 1e-4, "extent": 0.05, "tool_pose_x": 0.2}


class Driver:
    """The driver's end: a session that has asked five times, and knows its simulation."""

    def __init__(self, peer):
        self.frame = exchange_step.make_near_frame(*CloudLayout(LOCAL_CONTACT).fixed(MOST))
        self.state, self.watch = np.zeros(1, exchange_step.STATE), np.zeros(exchange_step.WATCHES, np.int64)
        self.state["session"], self.state["sequence"], self.state["peer_session"] = SESSION, 5.0, peer
        self.state["sent"][0, 3] = 123
        self.near, self.mail = np.zeros(1, contact_model.SET), seqlock.SeqLock(contact_model.SET)

    def take(self, data):
        self.frame.incoming[: len(data)] = np.frombuffer(data, np.uint8)[: len(self.frame.incoming)]
        return exchange_step.take_in_contacts(
            self.frame, len(data), self.state[0], self.watch, self.near, self.mail.words
        )


class Contacts:
    """What a simulation says of its local contacts: one flat one, which may be given otherwise."""

    def __init__(self, given):
        self.common, self.table = SAID, np.zeros((MOST, len(EACH)))
        flat = {"identity": 4.0, "kind": contact_model.FLAT_THERE, "normal_x": 1.0}
        for name, value in (flat | given).items():
            self.table[2, EACH.index(name)] = value

    def look(self, lag):
        """All is said."""


def packed(answers=3.0, session=SESSION, peer=PEER, scene=0, **given):
    """The local contacts that go with the answer of the simulation `peer` to this handle sample."""
    end = ExchangeEndpoint(Recording(Contacts(given)), HOME, "local")
    end.session, end.scene = peer, scene
    assert end.answer([handle(answers, session, exchange_method=float(exchange_samples.LOCAL))], 0) is not None
    return end.local_contacts()


@pytest.fixture
def driver():
    return Driver(PEER)


def test_what_is_packed_arrives_with_the_time_of_the_sample_it_answers(driver):
    assert driver.take(packed()) == contact_model.ACCEPTED
    found = driver.mail.get()[0]
    assert (found.number, found.sent, found.trust, found.mass, found.tool_pose_x) == (3.0, 123.0, 0.5, 0.1, 0.2)
    assert found.table[2, contact_model.IDENTITY] == 4.0 and found.table[2, contact_model.NORMAL_X] == 1.0


def test_a_set_has_the_length_at_which_it_arrives(driver):
    """RTPS rounds a payload up to four bytes; one of another length than the driver's own is refused."""
    assert len(packed()) % 4 == 0 and len(packed()) == len(driver.frame.template)


def test_late_repeated_foreign_and_nonsensical_sets_are_refused_and_counted(driver):
    assert driver.take(packed()) == contact_model.ACCEPTED
    assert driver.take(packed()) == contact_model.OLD
    assert driver.take(packed(2.0)) == contact_model.OLD
    assert driver.take(packed(6.0)) == contact_model.NOT_MINE
    assert driver.take(packed(4.0, OTHER)) == contact_model.NOT_MINE
    assert driver.take(packed(4.0, peer=PEER + 2.0)) == contact_model.OTHER_SENDER
    assert driver.take(packed(4.0, normal_x=0.5)) == contact_model.NOT_A_CONTACT
    assert driver.take(packed(4.0, gap=np.nan)) == contact_model.NOT_FINITE
    assert driver.take(packed(4.0)[:-8]) == contact_model.OTHER_LAYOUT
    assert driver.watch[exchange_step.SEEN] == 1 and driver.watch[exchange_step.UNSEEN :].sum() == 8
    assert driver.mail.get()[0].number == 3.0


def test_whatever_is_wrong_with_a_set_what_counts_stays_finite(driver):
    dice, whole = random.Random(7), packed()
    verdicts = set()
    for _ in range(20_000):
        driver.state["near_answered"] = 0.0
        verdicts.add(driver.take(mutated(whole, dice)))
        assert np.isfinite(driver.near["table"]).all() and np.isfinite(driver.near["trust"]).all()
    assert len(verdicts) >= 5, "the mutations reach many refusals"


def test_contacts_of_a_scene_that_was_left_are_refused(driver):
    old = packed(4.0)
    assert driver.take(packed(scene=1)) == contact_model.ACCEPTED
    assert driver.take(old) == contact_model.OTHER_SCENE
