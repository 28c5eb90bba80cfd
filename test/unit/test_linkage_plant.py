# SPDX-License-Identifier: Apache-2.0
"""A linkage as physics: its motion is Hamilton's, its joints rub and count, and where its energy goes."""

import math

import numpy as np
import pytest
from plants import InPython, ns
from scipy.integrate import solve_ivp

from haptic_device.config.description import Device, load_device
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import NODES
from haptic_device.device import loopback_config, plant

NAMES = "haply_2diy_gen3", "pantograph_mk2", "serial_2r", "hapkit"
FIVE_BAR, PANTOGRAPH, SERIAL, HAPKIT = map(load_device, NAMES)
START = (0.01, 0.06)
OF_HAND = "hand_mass", "hand_damping", "hand_stiffness"
HAND, NO_HAND, STIFF = (
    dict(zip(OF_HAND, of, strict=True)) for of in ((0.1, 8.0, 500.0), (0.0, 0.0, 0.0), (0.05, 0.0, 10000.0))
)
STRAIGHT = 3  # a path of straight lines


class Linked(InPython):
    """A linkage's plant at START; `of_joints` replaces what its joints are described with."""

    def __init__(self, device, hand=HAND, **of_joints):
        super().__init__()
        joints = tuple(joint.model_copy(update=of_joints) for joint in device.joints)
        self.device, self.n = device.model_copy(update={"joints": joints}), len(joints)
        self.start = np.array([*START[: self.n], 0.0, 0.0])[:3]
        self.record = loopback_config.plant_of(self.device)
        for field, value in hand.items():
            self.record[field][0, :2] = value
        self.memory["position"] = self.memory["target"] = self.start
        self.script((0.0, *self.start, 1.0))
        self.turn(0.0, *np.zeros(self.n))
        self.at(0.0)

    def turn(self, time, *torque):
        """Pushes the joints with these torques."""
        return self.push(time, *(torque / self.record["force_per_motor"][0, : self.n]))

    def joints(self):
        """Angles and speeds [rad, rad/s]."""
        return self.memory["joint"][0, : self.n].copy(), self.memory["joint_velocity"][0, : self.n].copy()


def pose(device, joints):
    """(place from the handle's origin, J)."""
    x, y, *jacobian, _ = device.kinematics.pose(*joints)
    return np.array([x, y]) - device.kinematics.origin, np.reshape(jacobian, (2, 2))[:, : len(joints)]


def inertia(device, joints, mass):
    jacobian = pose(device, joints)[1]
    return np.diag([joint.inertia for joint in device.joints]) + mass * jacobian.T @ jacobian


def hamilton(device, hand, target, rate, torque, now, until):
    """(joints, momenta, work of the hand) after this time by Hamilton's equations, ∂H/∂θ by differences."""
    n, step, mass = device.kinematics.joints, 1e-3, device.handle.mass + hand["hand_mass"]
    damping, ways = np.array([joint.damping for joint in device.joints]), step * np.eye(n)

    def energy(joints, momenta):
        return 0.5 * momenta @ np.linalg.solve(inertia(device, joints, mass), momenta)

    def rates(t, now):
        joints, momenta = now[:n], now[n : 2 * n]
        near, far = (
            np.array([energy(joints + i * way, momenta) - energy(joints - i * way, momenta) for way in ways])
            for i in (1, 2)
        )
        place, jacobian = pose(device, joints)
        speeds = np.linalg.solve(inertia(device, joints, mass), momenta)
        pull = hand["hand_stiffness"] * (target + rate * t - place) + hand["hand_damping"] * (rate - jacobian @ speeds)
        changes = torque - damping * speeds + jacobian.T @ pull - (8.0 * near - far) / (12.0 * step)
        return [*speeds, *changes, pull @ jacobian @ speeds]

    return solve_ivp(rates, (0.0, until), now, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]


@pytest.mark.parametrize(
    "device, most, hand",
    [(FIVE_BAR, 0.1, HAND), (PANTOGRAPH, 0.1, STIFF), (SERIAL, 1.0, HAND), (HAPKIT, 0.02, HAND)],
    ids=NAMES,
)
def test_hand_motors_and_a_linkage_move_for_a_second_as_hamilton_says(device, most, hand):
    moved, dice, span = Linked(device, hand, coulomb=0.0), np.random.default_rng(1), 0.02
    way, mass, far = np.array([0.02, 0.01 * (moved.n > 1)]), device.handle.mass + hand["hand_mass"], 0.0
    moved.script((0.0, *moved.start, 1.0), (1.0, *(moved.start + [*way, 0.0]), 1.0))
    moved.motion["kind"] = STRAIGHT
    now = np.array([*moved.joints()[0], *np.zeros(moved.n + 1)])
    for t in np.arange(0.0, 1.0, span):
        torque = dice.uniform(-most, most, moved.n)
        moved.turn(t, *torque)
        now = hamilton(moved.device, hand, moved.start[:2] + way * t, way, torque, now, span)
        state, joints = moved.at(t + span), now[: moved.n]
        place, jacobian = pose(device, joints)
        speed = jacobian @ np.linalg.solve(inertia(device, joints, mass), now[moved.n : -1])
        far = max(far, np.linalg.norm(state.position - moved.start))
        assert np.abs(state.position[:2] - place).max() <= 1e-12
        assert state.velocity[:2] == pytest.approx(speed, abs=1e-10)
        assert state.energy == pytest.approx(0.5 * hand["hand_mass"] * speed @ speed - now[-1], abs=1e-11)
    assert far > 0.02


@pytest.mark.parametrize("device, most", [(PANTOGRAPH, 0.1), (SERIAL, 1.0), (HAPKIT, 0.02)], ids=NAMES[1:])
def test_energy_is_what_the_motors_give_less_what_is_kept_and_lost_by_damping_and_friction(device, most):
    friction, dice, step = 0.2 * most, np.random.default_rng(2), 1e-5
    moved, lost, unseen, stood = Linked(device, coulomb=friction), 0.0, 0.0, 0
    damping, (angle, speed) = moved.record["damping"][0, : moved.n], moved.joints()
    for k in range(20000):
        if k % 200 == 0:
            torque = dice.uniform(-most, most, moved.n)
            moved.turn(k * step, *torque)
        now = moved.at((k + 1) * step)
        (a, b), (angle, speed) = (angle, speed), moved.joints()
        middle = 1.5 * (angle - a) / step - 0.25 * (b + speed)
        lost += damping @ (b * b + 4.0 * middle**2 + speed**2) * step / 6.0 + friction * np.abs(angle - a).sum()
        lost -= torque @ (angle - a)
        unseen += friction * step / 4.0 * np.abs(speed - b)[b * speed < 0.0].sum()  # at most, on a way to and fro
        stood += ((speed == 0.0) & (b == 0.0)).sum()
    kept = 0.5 * speed @ inertia(device, angle, device.handle.mass) @ speed
    assert stood > 100 and np.abs(now.position - moved.start).max() > 1e-4 and unseen < 1e-7
    assert -unseen - 1e-9 * most <= now.energy + lost + kept <= 1e-9 * most


def test_a_joint_stays_at_rest_while_friction_holds_it_and_its_neighbour_slides():
    held, slides, friction = 0.999, 1.001, 0.02
    for one, two in ((held, slides), (-slides, held), (held, -held), (slides, slides)):
        rough = Linked(SERIAL, NO_HAND, coulomb=friction)
        before = rough.joints()[0]
        rough.turn(0.0, one * friction, two * friction)
        rough.at(0.05)
        way = rough.joints()[0] - before
        assert [w != 0.0 for w in way] == [abs(one) > 1.0, abs(two) > 1.0]
        assert way[0] * one >= 0.0 and way[1] * two >= 0.0


def test_a_second_link_whose_shoulder_sticks_starts_and_stops_as_one_inertia_with_damper_and_friction():
    joint, friction, torque, cut = SERIAL.joints[1], 0.1, 0.4, 0.03
    rough = Linked(SERIAL, NO_HAND, coulomb=friction)
    rough.record["coulomb"][0, 0] = 10.0
    shoulder, begun = rough.joints()[0]
    rough.turn(0.0, 0.0, torque)
    lag = (joint.inertia + SERIAL.handle.mass * SERIAL.kinematics.distal**2) / joint.damping
    fast, slow = (torque - friction) / joint.damping, friction / joint.damping
    rough.at(cut)
    way, speed = fast * (cut + lag * math.expm1(-cut / lag)), -fast * math.expm1(-cut / lag)
    assert rough.joints()[0] == pytest.approx([shoulder, begun + way], abs=1e-13)
    assert rough.joints()[1] == pytest.approx([0.0, speed], abs=1e-11)
    rough.turn(cut, 0.0, 0.0)
    stops = lag * math.log1p(speed / slow)
    way += lag * speed - slow * stops
    for after, stands in ((stops - 1e-6, False), (stops + 1e-6, True), (stops + 0.1, True)):
        state = rough.at(cut + after)
        assert (rough.joints()[1][1] == 0.0) == stands and rough.joints()[1][0] == 0.0
    assert rough.joints()[0] == pytest.approx([shoulder, begun + way], abs=1e-12)
    assert state.energy == pytest.approx(0.0, abs=1e-14) and not state.operator.any()


def test_a_sector_pulley_moves_as_an_axis_of_the_mass_damping_and_friction_that_are_felt():
    friction, travel = 2e-4, HAPKIT.kinematics.travel
    pulley = Linked(HAPKIT, coulomb=friction)
    joint = pulley.device.joints[0]
    mass, damping = joint.inertia / travel**2 + HAPKIT.handle.mass, joint.damping / travel**2
    axis = InPython(x=(mass, damping, friction / travel, 0.0, *HAND.values(), START[0]))
    for one in (pulley, axis):
        one.script((0.0, START[0], 0.0, 0.0, 1.0), (0.1, -0.02, 0.0, 0.0, 1.0), (0.2, 0.0, 0.0, 0.0, 0.0))
    for k in range(40):
        torque = 0.01 * math.sin(k)
        pulley.turn(0.01 * k, torque)
        axis.push(0.01 * k, torque / travel)
        one, two = pulley.at(0.01 * (k + 1)), axis.at(0.01 * (k + 1))
        assert one.position == pytest.approx(two.position, abs=1e-12)
        assert one.velocity == pytest.approx(two.velocity, abs=1e-11)
        assert one.operator == pytest.approx(two.operator, abs=1e-9)
        assert one.motor == pytest.approx(two.motor, rel=1e-12)
        assert one.energy == pytest.approx(two.energy, abs=1e-9)


def test_encoders_count_joints_late_and_motors_turn_them_no_more_than_they_can():
    changes = {"encoder_sign": -1, "motor_sign": -1, "gear": 2.0, "zero": 0.3, "torque_constant": 0.5}
    moved = Linked(PANTOGRAPH, **changes)
    moved.record["sensing_delay"] = ns(0.003)
    limit, per_rad = 2.0 * 0.123, 2.0 * PANTOGRAPH.joints[0].counts_per_rad
    first = moved.sense()[0]
    assert moved.device.joints[0].turned(0.3 - first[0] / per_rad) == pytest.approx(0.3 - first[0] / per_rad)
    assert np.abs(pose(PANTOGRAPH, 0.3 - first[:2] / per_rad)[0] - START).max() <= 1e-5
    moved.push(0.0, -0.1, 5.0)
    state = moved.at(0.02)
    assert moved.memory["torque"][0] == pytest.approx([0.1, -limit])
    _, jacobian = pose(PANTOGRAPH, moved.joints()[0])
    assert jacobian.T @ state.motor[:2] == pytest.approx([0.1, -limit])
    earlier = moved.joints()[0]
    moved.at(0.023)
    assert np.abs(0.3 - moved.sense()[0][:2] / per_rad - earlier).max() <= 0.5001 / per_rad
    assert np.abs(moved.joints()[0] - earlier).max() > 3.0 / per_rad and not moved.sense()[1].any()


@pytest.mark.parametrize("device", [FIVE_BAR, PANTOGRAPH, SERIAL, HAPKIT], ids=NAMES)
def test_a_hand_that_starts_in_a_corner_finds_the_joints_within_their_limits_and_none_outside(device):
    values = defaults(NODES["haptic_loopback"])
    for low in (0, 1):
        corner = np.array([*(along[low] for along in device.handle.used), 0.0, 0.0])[:3]
        body, memory, _ = loopback_config.hand_from(device, values | {"motion.start": tuple(corner)})
        counts = np.zeros(3)
        plant.sense(body[0], memory[0], 0, counts, np.zeros(3))
        angles = [counts[i] * joint.step + joint.zero for i, joint in enumerate(device.joints)]
        assert all(joint.limits[0] <= at <= joint.limits[1] for at, joint in zip(angles, device.joints, strict=True))
        steps = [1.0 / axis.counts_per_unit for axis in device.axes]
        assert np.abs(pose(device, angles)[0] - corner[:2]).max() <= max(steps)
        with pytest.raises(ValueError, match=r"motion.start x is at .* m of the device; its workspace is"):
            loopback_config.hand_from(device, values | {"motion.start": tuple(1.01 * corner)})


def test_theta_beside_two_joints_is_an_axis_of_its_own():
    theta, desktop = load_device("desktop").axes[2], InPython()
    both = Device.model_validate(SERIAL.model_dump(exclude={"axes", "link"}) | {"axes": [theta.model_dump()]})
    body, desk = loopback_config.plant_of(both), loopback_config.plant_of(load_device("desktop"))
    beside = Linked(SERIAL)
    beside.record, desktop.record = body, desk
    for one in (beside, desktop):
        one.record["hand_stiffness"][0, 2] = 1.0
        one.push(0.0, 0.1, 0.1, 0.3)
    one, two = beside.at(0.1), desktop.at(0.1)
    assert one.position[2] == two.position[2] != 0.0 and one.motor[2] == two.motor[2] != 0.0
    assert beside.sense()[0][2] == desktop.sense()[0][2]


def test_a_linkage_that_is_pushed_to_its_end_stands_there_as_it_was_put_together_and_comes_back():
    for device in (PANTOGRAPH, SERIAL):
        pushed = Linked(device, NO_HAND)
        for t in np.arange(0.0, 1.0, 0.01):
            pushed.at(t)
            _, jacobian = pose(device, pushed.joints()[0])
            pushed.turn(t, *np.clip(jacobian.T @ [0.0, 0.5 if t < 0.5 else -0.5], -0.05, 0.05))
            assert 0.0 < device.kinematics.pose(*pushed.joints()[0])[-1] <= 1.0
            if t < 0.5:
                highest = pushed.memory["position"][0, 1]
        assert highest > device.handle.used[1][1] and pushed.at(1.0).position[1] < highest - 0.01
