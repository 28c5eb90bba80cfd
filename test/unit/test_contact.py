# SPDX-License-Identifier: Apache-2.0
"""Local contacts: their geometry follows the tool exactly, what they do in one tick, nonsense is refused."""

import math

import numpy as np
import pytest
from apart import apart

from haptic_device.control import contact_model
from haptic_device.control import contact_solver as law
from haptic_device.jit import kernel
from haptic_sim.exchange.local_contacts import LocalContacts
from haptic_sim.method_registry import make
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load, parse

# kept in the cache
place, hide_others, judge_table, solve = (
    kernel(one.py_func)
    for one in (contact_model.place, contact_model.hide_others, contact_model.judge_table, law.solve)
)


def one(**given):
    row = np.zeros(len(contact_model.EACH))
    for name, value in ({"identity": 1.0, "kind": contact_model.FLAT_THERE, "normal_x": 1.0} | given).items():
        row[contact_model.EACH.index(name)] = value
    return row


def placed(row, pose, age=0.0, back=0.0):
    out = np.zeros(contact_model.PLACE)
    place(row, np.array(pose, float), age, back, out)
    return out


EDGE = {"kind": contact_model.FLAT_HERE, "normal_x": 0.0, "normal_y": 1.0, "tool_y": -0.01, "point_x": 0.03}
SIDE, TILT = {"radius": 0.01, "tool_radius": 0.01, "high": 0.02}, 0.1  # an edge that goes up from the origin
TILTED = 0.02 * math.cos(TILT) - 0.01 + 0.03 * math.sin(TILT), -math.sin(TILT), math.cos(TILT), 0.03, -0.02


@pytest.mark.parametrize(
    ("given", "pose", "expected"),
    [
        ({"tool_x": 0.01, "tool_y": 0.02}, (0.5, 0.0, math.pi / 2), (0.48, 1.0, 0.0, -0.02, 0.01)),
        (EDGE, (0.0, 0.02, TILT), TILTED),
        (SIDE, (0.03, 0.01, 0.0), (0.02, 1.0, 0.0, -0.01, 0.0)),
        (SIDE, (0.03, -0.04, 0.0), (0.04, 0.6, -0.8, -0.006, 0.008)),
    ],
    ids=["a corner of the tool", "an edge of the tool turns its normal", "a disc", "a disc beyond the edge's end"],
)
def test_gap_normal_and_lever_arm_are_those_of_the_tools_present_pose(given, pose, expected):
    assert placed(one(**given), pose) == pytest.approx(expected)


def test_a_surface_that_moves_and_is_pushed_back_is_where_that_has_brought_it():
    row = one(velocity_x=0.2)
    assert placed(row, (0.1, 0, 0), age=0.01)[0] == pytest.approx(0.098)
    assert placed(row, (0.1, 0, 0), age=0.01, back=0.003)[0] == pytest.approx(0.101)


@pytest.mark.parametrize("kind", [contact_model.FLAT_THERE, contact_model.FLAT_HERE])
def test_the_rate_of_a_gap_is_its_normal_and_arm_times_the_tools_velocity(kind):
    row = one(kind=kind, normal_x=0.6, normal_y=0.8, tool_x=0.01, tool_y=-0.03, point_x=0.02, point_y=0.01)
    pose, way = np.array((0.1, -0.2, 0.7)), np.array((0.3, -0.5, 2.0))
    gap, nx, ny, ax, ay = placed(row, pose)
    step = 1e-6
    rate = (placed(row, pose + step * way)[0] - placed(row, pose - step * way)[0]) / (2 * step)
    assert rate == pytest.approx(nx * way[0] + ny * way[1] + way[2] * (ax * ny - ay * nx), rel=1e-7)


def test_of_a_group_the_plane_with_the_largest_gap_counts():
    table, gaps, shown = np.zeros((8, len(contact_model.EACH))), np.zeros((8, contact_model.PLACE)), np.zeros(8)
    table[:4, contact_model.IDENTITY], table[:3, contact_model.GROUP] = (1, 2, 3, 4), (7, 7, 8)
    gaps[:4, 0] = 0.1, 0.2, 0.0, -1.0
    hide_others(table, gaps, shown)
    assert shown.tolist() == [0, 1, 1, 1, 0, 0, 0, 0]


@pytest.mark.parametrize(
    "given, verdict",
    [
        ({}, contact_model.ACCEPTED),
        ({"normal_x": 0.0}, contact_model.NOT_A_CONTACT),
        ({"normal_x": 1.01}, contact_model.NOT_A_CONTACT),
        ({"friction": -0.1}, contact_model.NOT_A_CONTACT),
        ({"restitution": 1.1}, contact_model.NOT_A_CONTACT),
        ({"mobility": -1.0}, contact_model.NOT_A_CONTACT),
        ({"kind": 4.0}, contact_model.NOT_A_CONTACT),
        ({"gap": math.nan}, contact_model.NOT_FINITE),
        ({"point_x": math.inf}, contact_model.NOT_FINITE),
        *(({name: 1e14}, contact_model.NOT_FINITE) for name in ("point_x", "point_y", "velocity_x", "velocity_y")),
    ],
)
def test_what_is_no_contact_is_refused(given, verdict):
    table = np.zeros((contact_model.MOST, len(contact_model.EACH)))
    table[3] = one(**given)
    assert judge_table(table) == verdict


@pytest.mark.parametrize("room, verdict", [(-0.9e-3, contact_model.ACCEPTED), (-1.1e-3, contact_model.NO_WAY_OUT)])
def test_planes_face_to_face_that_leave_no_room_are_refused(room, verdict):
    table = np.zeros((contact_model.MOST, len(contact_model.EACH)))
    table[0], table[1] = one(gap=room / 2), one(identity=2.0, normal_x=-1.0, gap=room / 2)
    assert judge_table(table) == verdict


@pytest.mark.parametrize("name", ["wall", "corner", "peg_in_hole", "wrench_on_nut", "push_block"])
def test_the_nearest_contact_is_as_far_as_fcl_says_where_features_face_each_other(name):
    scene = load(name)
    near = LocalContacts(reduce_scene(scene), make("impulse", reduce_scene(scene), 1e-3))
    shown, gaps = np.zeros(contact_model.MOST), np.zeros((contact_model.MOST, contact_model.PLACE))
    pose = np.array(scene.tool.pose)
    for row, gap in zip(near.table, gaps, strict=True):
        if row[contact_model.IDENTITY]:
            place(row, pose, 0.0, 0.0, gap)
            assert gap[0] <= max(row[contact_model.GAP], gap[0])
    hide_others(near.table, gaps, shown)
    least = min(
        apart(scene.tool, scene.tool.pose, body, body.pose)
        for body in scene.bodies
        if body.name != "floor" or name == "corner"
    )
    found = gaps[shown > 0.0, 0].min()
    assert found <= least + 1e-9
    if name in ("wall", "corner"):
        assert found == pytest.approx(least, abs=1e-9)


def test_wherever_the_tool_goes_within_the_trust_a_set_touches_where_the_shapes_do():
    scene, random = load("peg_in_hole"), np.random.default_rng(1)
    gaps, shown = np.zeros((contact_model.MOST, contact_model.PLACE)), np.zeros(contact_model.MOST)
    for _ in range(60):
        pose = np.array((random.uniform(-2e-3, 2e-3), random.uniform(0.06, 0.115), random.uniform(-0.02, 0.02)))
        here = scene.model_copy(update={"tool": scene.tool.model_copy(update={"pose": tuple(pose)})})
        near = LocalContacts(reduce_scene(here), make("impulse", reduce_scene(here), 1e-3))
        for row, gap in zip(near.table, gaps, strict=True):
            place(row, pose, 0.0, 0.0, gap)
        known = near.table[:, contact_model.IDENTITY] > 0.0
        for nx, ny in gaps[known, contact_model.NX : contact_model.NY + 1].tolist():
            there = pose - 0.99 * near.trust * np.array((nx, ny, 0.0))
            for row, gap in zip(near.table, gaps, strict=True):
                place(row, there, 0.0, 0.0, gap)
            hide_others(near.table, gaps, shown)
            inside = apart(here.tool, tuple(there), here.bodies[0], here.bodies[0].pose) <= 0.0
            assert (gaps[shown > 0.0, 0].min() < 0.0) == inside


@pytest.mark.parametrize("speed, stands_in", [(0.0, True), (1e-3, False)])
def test_a_tool_that_can_touch_a_belt_is_not_trusted_to_the_servo(speed, stands_in):
    scene = load("push_block")
    belt, block = scene.bodies
    scene = scene.model_copy(update={"bodies": (belt.model_copy(update={"surface_velocity": (speed, 0.0)}), block)})
    assert (LocalContacts(reduce_scene(scene), make("partitioned", reduce_scene(scene), 1e-3)).trust > 0.0) == stands_in


@pytest.mark.parametrize(
    "more, mobility", [({}, 0.5), ({"motor": {"speed": 0.0, "max_force": 1.0}}, 0.0), ({"friction_force": 1.0}, 0.0)]
)
def test_what_a_slider_carries_gives_way_by_its_mass_unless_a_motor_or_friction_holds_it(more, mobility):
    load_ = {"name": "load", "mass": 2.0, "pose": [0.021, 0.0, 0.0], "shapes": [{"box": {"size": [0.02, 0.02]}}]}
    guide = {"type": "slider", "bodies": ["world", "load"], "at": [0.021, 0.0], "axis": [1.0, 0.0], **more}
    tool = {"mass": 0.1, "shapes": [{"circle": {"radius": 0.01}}]}
    scene = parse({"name": "t", "bodies": [load_], "joints": [guide], "tool": tool}, "t")
    near = LocalContacts(reduce_scene(scene), make("partitioned", reduce_scene(scene), 1e-3))
    assert near.table[:, contact_model.IDENTITY].any()
    assert near.table[:, contact_model.MOBILITY].max() == pytest.approx(mobility)


MOST = law.EXACT + law.BRAKED
SOFT = 0.016  # [1/kg] of 1e-9 m/N at 4 kHz


def contact(normal, arm, gap_rate, friction=0.0, soft=SOFT):
    """A row: normal and arm (x, y), rate of the gap that there is already [m/s]."""
    row, (nx, ny), (ax, ay) = np.zeros(law.COLUMNS), normal, arm
    row[law.N_X : law.N_TURN + 1] = nx, ny, ax * ny - ay * nx
    row[law.T_X : law.T_TURN + 1] = -ny, nx, ax * nx + ay * ny
    row[law.B_N], row[law.E_N], row[law.E_T], row[law.MU] = gap_rate, soft, 1e-3 * soft, friction
    return row


def solved(mass, velocity, *contacts):
    rows, found = np.array(contacts), np.zeros(3)
    mass = np.array(mass, float)
    turns = solve(rows, mass, mass * velocity, np.zeros((3, 4)), found, MOST)
    return turns, found, rows


def test_a_body_that_falls_on_a_floor_stops_but_for_the_compliance_and_a_lifted_one_goes_on():
    turns, velocity, rows = solved((0.1, 0.1, 1e-4), (0.3, -1.0, 0.0), contact((0, 1), (0, 0), 0.0))
    force = 1.0 / (1.0 / 0.1 + SOFT)
    assert turns == 2 and rows[0, law.IMPULSE] == pytest.approx(force, rel=1e-12)
    np.testing.assert_allclose(velocity, (0.3, -SOFT * force, 0.0), atol=1e-12)
    turns, velocity, rows = solved((0.1, 0.1, 1e-4), (0.3, 1.0, 0.0), contact((0, 1), (0, 0), 0.0))
    assert turns == 1 and rows[0, law.IMPULSE] == 0.0 and velocity[1] == 1.0


@pytest.mark.parametrize("friction, sticks", [(0.29, False), (0.31, True)])
def test_it_sticks_just_above_the_friction_that_stops_it_and_slides_just_below(friction, sticks):
    _, velocity, rows = solved((0.1, 0.1, 1e9), (0.3, -1.0, 0.0), contact((0, 1), (0, 0), 0.0, friction, 1e-6))
    if sticks:
        assert abs(velocity[0]) < 1e-6
    else:
        assert velocity[0] == pytest.approx(0.3 - friction, rel=1e-4)
        assert rows[0, law.SLIP_IMPULSE] == pytest.approx(friction * rows[0, law.IMPULSE])  # against the slip


def test_a_wedge_of_two_planes_holds_in_every_direction_they_face():
    planes = contact((0.6, 0.8), (0, 0), 0.0, soft=1e-6), contact((-0.6, 0.8), (0, 0), 0.0, soft=1e-6)
    turns, velocity, rows = solved((0.1, 0.1, 1e-4), (0.0, -1.0, 0.0), *planes)
    assert turns <= 3 and np.abs(velocity).max() < 1e-6
    assert rows[0, law.IMPULSE] == pytest.approx(0.1 / 1.6, rel=1e-4) == rows[1, law.IMPULSE]


def random_contacts(random, count):
    for _ in range(count):
        angle, arm = random.uniform(0, 2 * np.pi), random.uniform(-0.03, 0.03, 2)
        normal = np.cos(angle), np.sin(angle)
        yield contact(normal, arm, random.uniform(-0.02, 0.1), random.choice([0.0, 0.2, 0.6]))


def violation(mass, given, velocity, rows):
    """Largest violation of the complementarity conditions and of the balance of momentum, relative."""
    pushed, worst = np.zeros(3), 0.0
    for row in rows:
        normal, slip = row[: law.T_X], row[law.T_X : law.B_N]
        impulse, along = row[law.IMPULSE], row[law.SLIP_IMPULSE]
        rate = normal @ velocity + row[law.B_N] + row[law.E_N] * impulse
        sliding = slip @ velocity + row[law.B_T] + row[law.E_T] * along
        bound = row[law.MU] * impulse
        worst = max(worst, -impulse, -rate, min(impulse, abs(rate)), abs(along) - bound)
        if abs(along) < bound * (1 - 1e-9):
            worst = max(worst, abs(sliding))
        elif bound > 0.0:
            worst = max(worst, sliding * np.sign(along) - row[law.E_T] * bound)
        pushed += normal * impulse + slip * along
    return max(worst, np.abs((mass * velocity - mass * given - pushed) / mass).max())


def test_what_is_found_exactly_fulfils_the_conditions_of_contact_and_is_found_at_once_again():
    random, mass, exact = np.random.default_rng(1), np.array((0.1, 0.1, 3e-5)), 0
    for _ in range(200):
        given = random.normal(size=3) * (0.3, 0.3, 10.0)
        turns, velocity, rows = solved(mass, given, *random_contacts(random, 4))
        if turns <= law.EXACT:
            exact += 1
            assert violation(mass, given, velocity, rows) < 1e-6
            assert solve(rows, mass, mass * given, np.zeros((3, 4)), velocity, MOST) == 1  # from its own answer
    assert exact > 130


def test_an_answer_is_nearly_always_found_and_takes_energy_from_contacts_that_do_not_move():
    random, mass, none = np.random.default_rng(3), np.array((0.1, 0.1, 3e-5)), 0
    for _ in range(100):
        given, contacts = random.normal(size=3) * (0.3, 0.3, 10.0), list(random_contacts(random, 6))
        for row in contacts:
            row[law.B_N] = abs(row[law.B_N])
            row[law.BOUND] = row[law.MU] * random.uniform(0.0, 0.05)
        turns, velocity, rows = solved(mass, given, *contacts)
        none += turns < 0
        assert turns <= law.EXACT + law.BRAKED
        assert turns < 0 or mass @ velocity**2 <= mass @ given**2 * (1.0 + 1e-9)
    assert none < 10  # for which the tool stays where it is


@pytest.mark.parametrize("most", [1, 5, 20])
def test_it_takes_no_more_solutions_than_it_may_and_says_where_that_was_too_few(most):
    random, mass, found = np.random.default_rng(4), np.array((0.1, 0.1, 3e-5)), 0
    for _ in range(100):
        given, rows = random.normal(size=3) * (0.3, 0.3, 10.0), np.array(list(random_contacts(random, 6)))
        turns = solve(rows, mass, mass * given, np.zeros((3, 4)), np.zeros(3), most)
        assert turns == -1 or 0 < turns <= most
        found += turns > 0
    assert 0 < found < 100
