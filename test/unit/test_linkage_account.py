# SPDX-License-Identifier: Apache-2.0
"""Linkages in the servo: the bound of a wall at each pose, searches for energy, and what joints make of a force."""

import numpy as np
import pytest
from examples import tries
from ticks import tick

from adversary import linkage_search
from adversary.linkage_search import DEVICES, SIDES, jacobian, one_of, stand, wall_of
from haptic_device.control import enable_state, faults, gain_check, linkage
from haptic_device.control.records import STATE, TRACE_ROW

BARE = {"passivity.policy": "off", "passivity.control": False}
ARMS, PLACE, NORMAL, T = "serial_2r", np.array((0.02, 0.07)), np.array((0.6, 0.8)), 1e-3
EACH = pytest.mark.parametrize("name", DEVICES)


class Ticks:
    """A servo of a linkage at 1 kHz whose joints are where a test says, from `place` on [rad]."""

    def __init__(self, name=ARMS, place=PLACE, wall=0.0, depth=0.01, coupling=0.0, **values):
        self.settings, self.memory = stand(one_of(name, **values), place), np.zeros(1, STATE)
        self.joints, self.count, self.tool = np.zeros(3), 0, (*place, 0.0)
        self.settings["coupling"]["stiffness"][0, :2] = coupling
        wall_of(self.settings, NORMAL, wall, NORMAL @ place + depth)
        gain_check.counted(self.settings, 0.0)
        self.settings["port"]["step"] = 0.0
        self.settings["hardware"]["position_low"], self.settings["hardware"]["position_high"] = -1.0, 1.0

    def run(self, ticks=10, speed=(0.0, 0.0), reset=0):
        """The last row of so many ticks; the joints turn by speed [rad/s]."""
        for _ in range(ticks):
            self.joints[:2] += np.array(speed) * T
            self.count += 1
            row = np.zeros(1, TRACE_ROW)
            row["deadline"] = row["latched"] = (1000 + self.count) * 10**6
            row["counts"] = self.joints / self.settings["hardware"]["position_per_count"][0]
            row["command"], row["device_status"] = enable_state.ENABLE + reset, faults.FRESH
            row["tool_session"], row["tool_sequence"], row["tool_answered"] = 1.0, self.count, self.count
            row["tool_position"] = self.tool
            tick(self.settings, self.memory, row)
        return row.view(np.recarray)[0]


@EACH
def test_a_hand_draws_energy_from_a_wall_above_the_bound_of_its_pose_and_none_below(name):
    """K T/2 nᵀ J b⁻¹ Jᵀ n = 1; in a cycle of its worst motion it is given 2 a²/T q (K T/2 q − 1), q = nᵀ J b⁻¹ Jᵀ n."""
    for place, normal, most, energies, left, refused in linkage_search.table(name):
        for share, energy, remains in zip(SIDES, energies, left, strict=True):
            way = linkage_search.WAY**2 * most
            assert energy == pytest.approx((share - 1.0) * way, rel=0.02), (place, normal)
            assert remains == pytest.approx(1.0 - share, abs=1e-3)
        if refused:
            assert refused[0] == "" and "needs b >" in refused[1]
            where = refused[1].partition("the handle at x = ")[2]
            assert where.removeprefix("-").startswith(f"{abs(place[0]):.3g} m") if name != "hapkit" else not where


@EACH
def test_whatever_hand_tool_settings_and_lateness_do_on_a_linkage_nothing_grows(name):
    for seed, (least, most), budget, kind, more in (
        (1, (0.0, 0.0), 2e-5, 1, {}),
        (2, (0.0, 1.0), 5e-3, 0, {"rate": 4000.0, "method": "pspm"}),
        (3, (1.25, 1.25), 2e-5, 2, {"motor": True, "slew": 50.0}),
    ):
        (given, held, _, grown), *_ = linkage_search.attack(
            name, seed, least, most, budget, kind, 1, tries(100), **more
        )
        assert given < 0.0 and max(held, grown) <= 1e-9
    more = {"step": True, "events": 0.05, "cancel": True}
    (given, held, *_), *_ = linkage_search.attack(name, 4, 0.0, 0.5, 5e-3, 1, 1, tries(100), **more)
    assert given < 0.0 and held <= 1e-9


@EACH
def test_the_same_search_leaks_where_joints_have_half_the_damping_that_is_told(name):
    (_, held, *_), *_ = linkage_search.attack(name, 1, 0.0, 0.0, 2e-5, 1, 2, 400, damping=0.5)
    assert held > 1e-6


def test_where_a_handle_moves_straight_nothing_is_ever_owed_whatever_gains_that_fit_come_and_go():
    for seed in range(4):
        found = linkage_search.attack("hapkit", seed, 0.0, 0.0, 2e-5, 2, 2, tries(200))[0]
        assert found[2] <= 1e-9


@pytest.mark.parametrize("share", (0.4, 1.01))
def test_motors_hold_the_torque_of_the_force_on_the_handle_and_a_limit_takes_of_that_its_size_alone(share):
    torque, servo = jacobian(ARMS, PLACE)[0].T @ NORMAL, Ticks(wall=100.0, **BARE)
    weak, hardware = int(np.argmin(np.abs(torque))), servo.settings["hardware"]
    hardware["motor_limit"][0, weak], hardware["motor_per_force"][0, :2] = share * abs(torque[weak]), (3.0, -2.0)
    row, left = servo.run(), min(1.0, share)
    assert row.force_on_handle[:2] == pytest.approx(left * NORMAL)
    assert row.torque[:2] == pytest.approx(left * torque)
    assert row.motor[:2] == pytest.approx(left * torque * (3.0, -2.0))
    assert servo.memory["hold"]["limited"][0, weak] == (share < 1.0)


@pytest.mark.parametrize(
    ("c", "share"), ((0.03, 0.0), (0.0499, 0.0), (0.051, 0.01), (0.1, 0.5), (0.149, 0.99), (0.151, 1.0))
)
@pytest.mark.parametrize("name", (ARMS, "haply_2diy_gen3"))
def test_forces_fade_before_a_singular_pose_and_are_none_at_it(name, c, share):
    link = one_of(name).view(np.recarray)[0].linkage
    low, high = 0.1, 0.18
    for _ in range(60):  # farther out, links stretch
        y = 0.5 * (low + high)
        low, high = (y, high) if linkage.angles(link, 0.0, y)[2] > c else (low, y)
    row = Ticks(name, np.array((0.0, y)), wall=100.0, **BARE).run()
    assert row.fault == faults.NONE
    assert row.force_on_handle[:2] == pytest.approx(share * NORMAL, abs=1e-6)


def test_links_on_the_other_side_of_a_singular_pose_latch_and_no_motor_pulls_until_they_are_back_and_reset():
    servo = Ticks(wall=100.0, **BARE)
    assert servo.run().motor[:2].all()
    elbow, servo.settings["port"]["fastest"] = -servo.settings["hardware"]["zero"][0, 1], 1e6
    place = servo.run(1, (0.0, -1.5 * elbow / T)).position.copy()
    row = servo.run()
    assert faults.name_of(row.fault) == "unreachable" and not row.motor.any()
    assert row.position[:2] == pytest.approx(PLACE) and row.position.tolist() == place.tolist()
    row = servo.run(10, (0.0, 0.15 * elbow / T))
    assert faults.name_of(row.fault) == "unreachable" and not row.motor.any()
    assert servo.run(20, reset=enable_state.RESET).fault == faults.NONE


@pytest.mark.parametrize(("share", "name"), ((0.99, ""), (1.98, "velocity"), (2.02, "encoder_jump")))
def test_a_jump_is_a_joints_at_twice_the_speed_that_the_handles_limit_makes_of_it(share, name):
    servo = Ticks()
    fastest = servo.settings["port"]["fastest"][0, 0]
    joints = np.array([np.linalg.inv(jacobian(ARMS, (x, y))[0]) for x in (-0.05, 0.05) for y in (0.03, 0.12)])
    assert fastest >= 2.0 * np.abs(joints).sum(axis=2).max(axis=0)[0] * (1.0 - 1e-9)
    servo.run()
    assert faults.name_of(servo.run(1, (share * fastest, 0.0)).fault) == name


def test_cancellation_gives_back_a_share_of_what_each_joint_loses():
    ratio, speed, damping = 0.3, np.array((0.5, -0.8)), jacobian(ARMS, PLACE)[1]
    servo = Ticks(**{"cancellation.ratio": ratio, "cancellation.stretch": 1.0})
    row = servo.run(40, speed)
    assert row.torque[:2] == pytest.approx(ratio * damping * speed, rel=5e-3)
    assert row.torque[:2] @ speed == pytest.approx(ratio * damping @ speed**2, rel=5e-3)


@pytest.mark.parametrize("name", DEVICES[:4])
def test_the_margin_that_is_told_is_the_one_of_this_pose(name):
    """1/λ_max(J b⁻¹ Jᵀ) − K T/2."""
    for place in linkage_search.places(name, 5, np.random.default_rng(2)):
        turn, damping = jacobian(name, place)
        felt = 1.0 / np.linalg.eigvalsh(turn / damping @ turn.T)[-1]
        row = Ticks(name, place, coupling=felt / T).run()
        assert row.margin[:2] == pytest.approx([0.5 * felt] * 2, rel=1e-6)


def test_gains_that_need_more_at_any_pose_are_not_softer():
    """A wall along x asks for less than one along y at the worst pose of each, and for more at another."""
    known, wished = (one_of("haply_2diy_gen3") for _ in range(2))
    for settings, normal, stiffness in ((known, (0.0, 1.0), 60.0), (wished, (1.0, 0.0), 80.0)):
        walls = settings["wall"]
        walls["count"], walls["x"][0, 0], walls["y"][0, 0], walls["stiffness"][0, 0] = 1, *normal, stiffness
        gain_check.counted(settings, 0.0)
    assert not gain_check.softer(wished[0], known[0], 0.0)
    wished["wall"]["x"][0, 0], wished["wall"]["y"][0, 0] = 0.0, 1.0
    for stiffness, softer in ((59.9, True), (60.1, False)):
        wished["wall"]["stiffness"][0, 0] = stiffness
        assert gain_check.softer(wished[0], known[0], 0.0) == softer


def test_a_hard_press_through_the_coupling_in_any_direction_is_no_saturation():
    for x, y in ((1.0, -1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)):
        servo = Ticks("pantograph_mk2", np.array((-0.0175, 0.045)), coupling=300.0, **{"fault.saturation": 0.05})
        servo.run(100)
        servo.tool = (-0.0175 + 0.02 * x, 0.045 + 0.02 * y, 0.0)
        row = servo.run(400)
        assert row.fault == faults.NONE and abs(row.force_on_handle).max() > 1.0
