# SPDX-License-Identifier: Apache-2.0
"""The least model: who moves, how freely, who can touch, what matters, and what the reduction leaves unchanged."""

import math

import numpy as np
import pytest

from haptic_device.config_files import names
from haptic_sim.method.closed_form import ClosedForm
from haptic_sim.protocol import Coupling, held
from haptic_sim.pymunk_world.world import PymunkWorld
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.measured import of_scene
from haptic_sim.reduction.method_choice import (
    ACTS,
    EASY,
    GREASE,
    HIGH,
    HOLDS,
    LAYERS,
    LOAD,
    LONG,
    SHORT,
    SHORT_PER_BODY,
    SOLVED,
    STEPS,
    STIFFNESS,
    TOUCHING,
)
from haptic_sim.reduction.model import PIN, SLIDER, SPRING
from haptic_sim.scene.language import SceneError, load, parse
from haptic_sim.verify import CREATED, OVERLAP, within
from reference.case import NAMES as CASES
from reference.trial import attempt

DISC = {"mass": 0.1, "pose": [0.5, 0.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
BAR = {"name": "bar", "mass": 1.0, "shapes": [{"box": {"size": [0.2, 0.02], "center": [0.1, 0.0]}}]}
STOP = {"name": "stop", "fixed": True, "shapes": [{"box": {"size": [0.02, 0.02]}}]}
WALL = {"name": "wall", "fixed": True, "shapes": [{"half_plane": {"normal": [1.0, 0.0]}}]}
PINNED = {"type": "pin", "bodies": ["world", "bar"], "at": [0.0, 0.0]}


def compiled(**parts):
    return reduce_scene(parse({"name": "test", "tool": DISC, **parts}, "here"))


@pytest.mark.parametrize("name", names("scenes"))
def test_every_scene_compiles_to_finite_numbers_that_fit_and_a_sub_step_that_divides_a_millisecond(name):
    reduced = reduce_scene(load(name))
    model = reduced.model
    finite = [array for key, array in model._asdict().items() if key not in ("mass", "inertia", "joint_limit")]
    assert all(np.isfinite(array).all() for array in finite)
    assert np.isfinite(model.mass).tolist() == [not fixed for fixed in model.fixed]
    assert not model.fixed[0]
    assert model.fixed[-1]
    assert len(reduced.shape_names) == len(model.shape_body) == len(model.shape_start) - 1
    assert 1e-3 / reduced.sub_step == pytest.approx(round(1e-3 / reduced.sub_step))
    assert all(reduced.reasons)
    for kind, bodies, anchors in zip(model.joint_kind, model.joint_bodies, model.joint_anchor, strict=True):
        if kind != SPRING:
            on_a, on_b = (place(model.pose[body], anchor) for body, anchor in zip(bodies, anchors, strict=True))
            assert on_a == pytest.approx(on_b, abs=1e-12)
    assert (model.shape_body[model.pairs[:, 0]] < model.shape_body[model.pairs[:, 1]]).all()


def place(pose, point):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + c * point[0] - s * point[1], pose[1] + s * point[0] + c * point[1]


def test_degrees_of_freedom_are_what_a_textbook_counts():
    """A four-bar has one, and its knob another; twelve of body coordinates less eight of four pins less two."""
    known = {"free_space": 3, "pendulum": 4, "slider": 2, "four_bar": 2, "stack": 18, "wrench_on_nut": 4}
    known["four_bar_singular"] = 2
    assert {name: reduce_scene(load(name)).needs.dof for name in known} == known


@pytest.mark.parametrize(("where", "apart"), [(0.2003, True), (0.2002, False)])
def test_a_bar_on_a_pin_reaches_a_stop_within_its_length_and_none_beyond(where, apart):
    needs = compiled(bodies=[BAR, {**STOP, "pose": [0.0, where + 0.01, 0.0]}], joints=[PINNED]).needs
    assert (("bar", "stop") not in needs.touching) == apart


def test_reaches_add_up_along_a_chain_of_pins():
    second = {**BAR, "name": "second", "pose": [0.2, 0.0, 0.0]}
    elbow = {"type": "pin", "bodies": ["bar", "second"], "at": [0.2, 0.0]}
    for where, touches in ((0.39, True), (0.43, False)):
        needs = compiled(bodies=[BAR, second, {**STOP, "pose": [0.0, where, 0.0]}], joints=[PINNED, elbow]).needs
        assert (("second", "stop") in needs.touching) == touches
        assert ("bar", "stop") not in needs.touching


def test_a_slider_adds_its_way_and_one_without_limits_goes_anywhere():
    rail = {"type": "slider", "bodies": ["world", "bar"], "at": [0.0, 0.0], "axis": [0.0, 1.0]}
    far = {**STOP, "pose": [0.0, 0.5, 0.0]}
    for limits, touches in (({"limits": [-0.1, 0.2]}, False), ({"limits": [-0.1, 0.3]}, True), ({}, True)):
        assert (("bar", "stop") in compiled(bodies=[BAR, far], joints=[rail | limits]).needs.touching) == touches


def test_bodies_in_other_layers_or_held_together_do_not_touch():
    assert ("tool", "bar") in compiled(bodies=[BAR]).needs.touching
    assert compiled(bodies=[{**BAR, "layers": [1]}]).needs.touching == ()
    joined = {"type": "pin", "bodies": ["tool", "bar"], "at": [0.3, 0.0]}
    assert compiled(bodies=[BAR], joints=[joined]).needs.touching == ()
    assert ("tool", "bar") in compiled(bodies=[BAR], joints=[joined | {"collide": True}]).needs.touching


def test_a_body_that_nothing_can_move_is_taken_for_fixed():
    lonely = {**BAR, "layers": [1]}
    assert compiled(bodies=[lonely]).needs.at_rest == ("bar",)
    assert len(compiled(bodies=[lonely]).model.mass) == 2
    for reason in (
        {"gravity": [0, -9.81]},
        {"bodies": [{**lonely, "velocity": [0, 0, 1]}]},
        {"bodies": [BAR]},
        {"joints": [PINNED | {"motor": {"speed": 1, "max_torque": 1}}]},
    ):
        assert compiled(**{"bodies": [lonely], **reason}).needs.moving == ("tool", "bar")


def test_welded_bodies_are_one_with_the_inertia_of_the_whole():
    half = {"mass": 1.0, "layers": [0]}
    left = half | {"name": "left", "pose": [-0.5, 0.0, 0.0], "shapes": [{"box": {"size": [1.0, 2.0]}}]}
    right = half | {"name": "right", "pose": [0.5, 0.0, math.pi], "shapes": [{"box": {"size": [1.0, 2.0]}}]}
    weld = {"type": "weld", "bodies": ["left", "right"], "at": [0.0, 0.0]}
    tool = {**DISC, "pose": [3.0, 0.0, 0.0]}
    whole = compiled(bodies=[left, right], joints=[weld], tool=tool)
    assert whole.model.mass[1] == 2.0
    assert whole.model.inertia[1] == pytest.approx(2.0 * (2.0**2 + 2.0**2) / 12)
    assert whole.places["right"].body == whole.places["left"].body == 1
    assert whole.places["right"].pose == pytest.approx((0.5, 0.0, math.pi))
    anchored = compiled(bodies=[left, right], tool=tool, joints=[weld, weld | {"bodies": ["world", "left"]}])
    assert len(anchored.model.mass) == 2


def test_joints_carry_their_numbers_into_the_model():
    spring = {"type": "spring", "bodies": ["tool", "bar"], "anchors": [[0, 0], [0.2, 0]], "stiffness": 5.0}
    rail = {"type": "slider", "bodies": ["world", "tool"], "at": [0.5, 0.0], "axis": [0.0, 3.0], "friction_force": 2.0}
    rail["motor"] = {"speed": -0.5, "max_force": 7.0}
    motor = PINNED | {"friction_torque": 0.5, "motor": {"speed": 3.0, "max_torque": 2.0}, "limits": [-1.0, 2.0]}
    model = compiled(bodies=[BAR], joints=[motor, rail, spring]).model
    assert model.joint_kind.tolist() == [PIN, SLIDER, SPRING]
    assert model.joint_bodies.tolist() == [[2, 1], [2, 0], [0, 1]]
    assert model.joint_friction.tolist() == [0.5, 2.0, 0.0]
    assert model.joint_motor.tolist() == [[3.0, 2.0], [-0.5, 7.0], [0.0, 0.0]]
    assert model.joint_limit[0].tolist() == [-1.0, 2.0]
    assert model.joint_axis[1] == pytest.approx([0.0, 1.0])
    assert model.joint_spring[2] == pytest.approx([5.0, 0.0, 0.3])
    assert model.joint_anchor[0, 1] == pytest.approx([-0.1, 0.0])


def test_a_belt_carries_the_velocity_of_its_surface_as_it_stands_in_the_plane_to_its_pairs_alone():
    belt = {**STOP, "pose": [0.0, -0.1, math.pi / 2], "surface_velocity": [0.3, -0.4]}
    needs = compiled(bodies=[BAR, belt], gravity=[0.0, -9.81])
    assert needs.needs.moving == ("tool", "bar")
    found = dict(zip(needs.needs.touching, needs.model.pair_surface.tolist(), strict=True))
    assert found == {
        ("tool", "bar"): [0.0, 0.0],
        ("tool", "stop"): pytest.approx([0.4, 0.3]),
        ("bar", "stop"): pytest.approx([0.4, 0.3]),
    }


@pytest.mark.parametrize(
    ("parts", "axes"),
    [
        ({}, ()),
        ({"bodies": [WALL]}, ((1.0, 0.0),)),
        ({"bodies": [WALL, {**WALL, "name": "floor", "pose": [0, -1, math.pi / 2]}]}, ((1.0, 0.0), (0.0, 1.0))),
        ({"bodies": [WALL, {**WALL, "name": "slant", "pose": [0, -1, 0.5]}]}, None),
        ({"bodies": [{**WALL, "shapes": [{"box": {"size": [0.1, 1]}}]}]}, None),
        ({"bodies": [{**WALL, "material": "rough"}], "tool": {**DISC, "material": "rough"}}, None),
        ({"bodies": [{**WALL, "material": "rough"}]}, ((1.0, 0.0),)),
        ({"bodies": [WALL], "tool": {**DISC, "shapes": [{"box": {"size": [0.02, 0.02]}}]}}, None),
        ({"bodies": [WALL], "tool": {**DISC, "shapes": [{"circle": {"radius": 0.01, "center": [0, 0.01]}}]}}, None),
    ],
)
def test_only_a_round_tool_among_smooth_square_walls_has_a_closed_form(parts, axes):
    needs = compiled(materials={"rough": {"friction": 0.1}}, **parts).needs
    assert (needs.axes is None) == (axes is None)
    assert np.array(needs.axes or ()) == pytest.approx(np.array(axes or ()))


def test_a_closed_form_wished_for_a_scene_without_one_is_refused():
    with pytest.raises(ValueError, match="'closed_form', which needs a round tool"):
        compiled(method="closed_form", bodies=[BAR])
    with pytest.raises(ValueError, match="has no closed form"):
        ClosedForm(reduce_scene(load("corner")), 1e-3)
    with pytest.raises(SceneError, match="method is 'euler'.*take one of impulse"):
        parse({"name": "test", "tool": DISC, "method": "euler"}, "here")


@pytest.mark.parametrize(("error", "step"), [(0.02, 0.25e-3), (0.2, 1e-3), (0.004, 0.05e-3), (1e-9, STEPS[-1])])
def test_the_sub_step_is_the_longest_whose_numerical_damping_is_the_error_stated(error, step):
    """Frequency 141 rad/s of 0.1 kg on 2000 N/m: 2 error / w is 0.283, 2.8, 0.057 ms."""
    assert compiled(error=error).sub_step == step


def on_each_other(count, **lowest):
    """So many blocks of 1 kg on a floor, the first as told."""
    blocks = [
        {"name": f"b{i}", "mass": 1.0, "pose": [0.0, 0.01 + 0.02 * i, 0.0], "shapes": [{"box": {"size": [0.04, 0.02]}}]}
        for i in range(count)
    ]
    floor = {"name": "floor", "fixed": True, "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    return {
        "gravity": [0.0, -9.81],
        "bodies": [floor, {**blocks[0], **lowest}, *blocks[1:]],
        "tool": {**DISC, "mass": 1.0, "pose": [0.5, 0.5, 0.0]},
    }


def reason(**parts):
    """(method, why) of a scene."""
    found = compiled(**parts)
    return found.method, found.reasons[0]


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_body_on_one_that_is_lighter_by_more_than_impulse_carries_gets_the_direct_solver(share):
    method, why = reason(**on_each_other(2, mass=2.0 / (share * LOAD)))
    assert (method == "partitioned") == (share > 1.0)
    assert ("b1 is" in why and "as heavy as b0, and 2 bodies stand on one another" in why) == (share > 1.0)


def test_a_mass_ratio_counts_across_a_joint_and_not_where_nothing_ever_touches():
    for share, method in ((0.99, "impulse"), (1.01, "partitioned")):
        speck = {**BAR, "name": "speck", "mass": 1.0 / (share * LOAD), "pose": [0.2, 0.0, 0.0], "layers": [2]}
        tied = {"type": "pin", "bodies": ["bar", "speck"], "at": [0.2, 0.0]}
        assert reason(bodies=[BAR, speck], joints=[PINNED, tied])[0] == method
        assert reason(bodies=[BAR, speck], gravity=[0.0, -9.81])[0] == "impulse"


@pytest.mark.parametrize("over", [0, 1])
@pytest.mark.parametrize(
    ("lowest", "count", "said"),
    [
        (0.1, round(LOAD / 10.0), f": a load of {LOAD + 10:g},"),
        (1.0, HIGH, f", and impulse takes at most {HIGH}"),
    ],
)
def test_a_tower_is_carried_up_to_its_height_times_its_mass_ratio_and_up_to_a_height(lowest, count, said, over):
    method, why = reason(**on_each_other(count + over, mass=lowest))
    assert method == ("partitioned" if over else "impulse")
    assert (f"{count + 1} bodies stand on one another{said}" in why) == bool(over)


def test_bodies_beside_each_other_or_in_the_air_are_no_tower():
    tower = on_each_other(8, mass=0.1)
    floor, blocks = tower["bodies"][0], tower["bodies"][1:]
    row = [{**block, "pose": [0.04 * i, 0.01, 0.0]} for i, block in enumerate(blocks)]
    gap = 1.1 * TOUCHING
    lifted = [{**block, "pose": [0.0, 0.01 + 0.02 * i + gap * (i + 1), 0.0]} for i, block in enumerate(blocks)]
    assert reason(**tower)[0] == "partitioned"
    for bodies in (row, lifted):
        assert reason(**tower | {"bodies": [floor, *bodies]})[0] == "impulse"


def test_what_is_more_than_the_direct_solver_takes_stays_with_impulse_and_says_so():
    method, why = reason(**on_each_other(40, mass=0.25))
    assert method == "impulse"
    assert "40 bodies stand on one another" in why
    assert "the scene has 42 bodies; the compiled methods take at most 40" in why


@pytest.mark.parametrize("times", [1.0, 30.0])
def test_impulse_carries_the_load_that_it_is_said_to_and_not_many_times_as_much(times):
    """A block falls by 50 mm on one that stands; overlaps are measured with the shapes, energy by the ledger."""
    parts = on_each_other(2, mass=1.0 / (times * LOAD))
    parts["bodies"][-1]["pose"] = [0.0, 0.08, 0.0]
    found = attempt(parse({"name": "test", **parts, "motion": {"name": "hold"}}, "here"), 0.3, "impulse")
    assert (found.overlap <= OVERLAP and found.created <= CREATED * found.scale) == (times == 1.0)


def test_a_smaller_error_than_impulse_holds_gets_the_direct_solver():
    parts = on_each_other(2)
    assert reason(**parts, error=1.01 * HOLDS)[0] == "impulse"
    method, why = reason(**parts, error=0.99 * HOLDS)
    assert method == "partitioned"
    assert "is wanted; impulse holds" in why


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_tool_so_light_on_its_coupling_that_it_asks_for_shorter_steps_gets_the_direct_solver(share):
    """sqrt(2000 N/m / m) = 2 error / h."""
    tool = {**DISC, "mass": STIFFNESS * (SHORT / 0.04) ** 2 / share}
    method, why = reason(bodies=[{**BAR, "mass": 0.01}], tool=tool)
    assert method == ("partitioned" if share > 1.0 else "impulse")
    assert ("impulse cannot keep up with steps below 0.05 ms" in why) == (share > 1.0)


def test_the_direct_solver_takes_steps_as_short_as_those_inside_impulse_unless_bodies_are_many():
    """On 1 kg the coupling allows 0.89 ms by default, 0.045 ms where the error is a twentieth."""
    for count, step in ((2, SHORT), (int(SHORT / SOLVED) - 1, SHORT), (20, 0.125e-3)):
        assert compiled(method="partitioned", **on_each_other(count)).sub_step == step
    assert compiled(method="partitioned", error=0.001, **on_each_other(20)).sub_step == 0.025e-3
    assert compiled(method="partitioned", sub_step=1e-3, **on_each_other(2)).sub_step == 1e-3


@pytest.mark.parametrize(
    ("error", "step"),
    [(0.02, 0.5e-3), (0.0046, 0.2e-3), (0.0044, ACTS), (0.0012, ACTS), (0.0011, 0.025e-3)],
)
def test_impulse_is_asked_no_more_often_than_it_can_keep_up_with_while_its_own_steps_keep_the_error(error, step):
    """On 1 kg the coupling allows 0.89 ms for 0.02; 0.206, 0.197, 0.054 and 0.049 ms for the others."""
    assert compiled(method="impulse", error=error, **on_each_other(2)).sub_step == step


@pytest.mark.parametrize(
    ("error", "inside"),
    [(0.02, LONG), (0.018, LONG), (0.01, 0.01), (0.0071, 0.0071), (0.004, SHORT)],
)
def test_inside_a_sub_step_impulse_takes_half_of_what_the_error_allows_the_fastest_mode_but_no_extremes(error, inside):
    """0.1 kg on 2000 N/m: error/141.4 1/s of the step is half of the error."""
    inside = inside if inside in (LONG, SHORT) else inside / math.sqrt(STIFFNESS / 0.1)
    assert compiled(error=error, bodies=[WALL, {**BAR, "mass": 0.1}]).inside == pytest.approx(inside, rel=1e-12)


def test_a_scene_with_a_joint_keeps_the_short_step():
    loose = {"bodies": [{**BAR, "mass": 0.1}]}
    assert compiled(**loose).inside == LONG and compiled(**loose, joints=[PINNED]).inside == SHORT


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_load_that_longer_steps_would_let_sink_in_keeps_the_short_step(share):
    found = compiled(tool=DISC | {"mass": 1.0}, bodies=[{**BAR, "mass": 1.0 / (share * EASY)}])
    assert found.inside == (LONG if share < 1.0 else SHORT)


def test_many_bodies_get_longer_steps_whatever_they_ask_for():
    for count in (4, 20):
        short = max(SHORT, SHORT_PER_BODY * (count + 1))
        assert compiled(error=0.002, **on_each_other(count)).inside == pytest.approx(short)


@pytest.mark.parametrize("fall", [0.5e-3, 10e-3, 50e-3])
def test_what_falls_on_a_block_in_long_steps_lies_in_it_no_deeper_than_in_short_ones(fall):
    parts = on_each_other(2)
    parts["bodies"][2]["pose"][1] += fall
    scene = parse({"name": "fall", "tool": {**DISC, "mass": 1.0}, "method": "impulse", **parts}, "here")
    found = [attempt(scene.model_copy(update={"error": error}), 0.2) for error in (0.02, 0.003)]
    assert max(one.overlap for one in found) < 9e-5


def test_the_parameter_method_wins_over_what_the_scene_needs_or_asks_for_and_says_so():
    scene = parse({"name": "test", "tool": DISC, "bodies": [BAR], "method": "impulse"}, "here")
    found = reduce_scene(scene, "partitioned")
    assert (found.method, found.sub_step) == ("partitioned", SHORT)
    assert found.reasons[0] == "the parameter method asks for it"
    assert reduce_scene(scene).reasons[0] == "the scene asks for it"


@pytest.mark.parametrize("name", names("scenes"))
def test_the_kept_table_has_each_shipped_scene_at_the_step_it_gets_and_the_chosen_method_keeps_its_bounds(name):
    """`python -m bench chosen --out haptic_sim/reduction/measured.csv` measures it anew."""
    scene, rows = load(name), {row.method: row for row in of_scene(name)}
    chosen = reduce_scene(scene)
    assert {"impulse", "partitioned", chosen.method} <= set(rows)
    for method, row in rows.items():
        assert row.step_us == pytest.approx(1e6 * reduce_scene(scene, method).sub_step)
    assert within(rows[chosen.method], scene.error)


def test_impulse_holds_the_error_that_it_is_said_to_in_every_scene_with_a_closed_form_or_stored_reference():
    rows = [row for name in CASES if name in names("scenes") for row in of_scene(name)]
    errors = [row.error for row in rows if row.method == "impulse"]
    assert len(errors) == 16
    assert 0.5 * HOLDS < max(errors) < HOLDS


def pressed(method, steps=1600, h=0.25e-3):
    """Tool's place and force for a handle that goes 20 mm into the wall along its face, and out again."""
    method.couple(Coupling(2000.0, 2.0, 2.0, 0.002))
    path = []
    for k in range(1, steps + 1):
        t = k * h
        method.step(held((0.03 - 0.04 * math.sin(8.0 * t), 0.01 * t, 0.1), (-0.32 * math.cos(8.0 * t), 0.01, 0.0)), 1)
        path.append((*method.position, *method.force_on_tool))
    return np.array(path)


def test_the_closed_form_gives_the_motion_that_the_whole_world_gives_for_small_steps():
    """They differ by how deep the general method sinks in before it sees a contact: at most one sub-step's way."""
    scene, fastest = load("wall"), 0.4
    for h in (50e-6, 20e-6):
        both = [pressed(kind(reduce_scene(scene), h), round(0.4 / h), h) for kind in (PymunkWorld, ClosedForm)]
        assert np.abs(both[0][:, :3] - both[1][:, :3]).max() < fastest * h
        free = both[1][:, 0] > 0.01 + 1e-9
        untouched = np.cumprod(free).astype(bool)
        assert np.abs(both[0][untouched] - both[1][untouched]).max() < 1e-9


def test_in_closed_form_no_wall_is_entered_and_none_pulls():
    method = ClosedForm(reduce_scene(load("wall")), 0.25e-3)
    method.couple(Coupling(2000.0, 2.0))
    pushes = []
    for k in range(800):
        method.step(held((0.03 - 0.1 * math.sin(0.02 * k), 0.0, 0.0)), 1)
        assert method.position[0] >= 0.01
        pushes += [contact.force_on_a[0] for contact in method.contacts()]
        assert method.touching == bool(method.contacts())
    assert len(pushes) > 100
    assert min(pushes) > 0.0


def test_closed_form_contacts_turn_with_the_wall():
    slanted = {**WALL, "pose": [0.0, 0.0, 0.6]}
    scene = parse({"name": "test", "bodies": [slanted], "tool": {**DISC, "pose": [0.1, 0.1, 0.0]}}, "here")
    method = ClosedForm(reduce_scene(scene), 1e-3)
    method.couple(Coupling(1000.0, 10.0))
    for _ in range(3000):
        method.step(held((0.0, 0.0, 0.0)), 1)
    (contact,) = method.contacts()
    normal = np.array([math.cos(0.6), math.sin(0.6)])
    assert method.position[:2] == pytest.approx(0.01 * normal, abs=1e-9)
    assert contact.force_on_a == pytest.approx(1000.0 * 0.01 * normal, rel=1e-6)
    assert contact.normal == pytest.approx(-normal)
    assert contact.point == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("share", [0.95, 1.05])
@pytest.mark.parametrize("kind", ["slider", "pin", "spring"])
def test_a_damper_that_sweeps_do_not_settle_gets_the_direct_solver(kind, share):
    block = {"name": "block", "mass": 0.01, "inertia": 1e-6, "shapes": [{"box": {"size": [0.02, 0.02]}}]}
    block["pose"] = [0.1, 0.0, 0.0]
    joint = {
        "slider": {"type": "slider", "at": [0.1, 0.05], "axis": [1.0, 0.0]},
        "pin": {"type": "pin", "at": [0.1, 0.05]},
        "spring": {"type": "spring", "anchors": [[0.3, 0.0], [0.0, 0.0]]},
    }[kind]
    seen = 1e-6 if kind == "pin" else 0.01
    joint |= {"bodies": ["world", "block"], "damping": share * GREASE * seen / SHORT}
    method, why = reason(bodies=[block], joints=[joint])
    assert method == ("partitioned" if share > 1.0 else "impulse")
    assert ("a damper holds a body back within" in why) == (share > 1.0)
    assert compiled(bodies=[block], joints=[joint]).sub_step == (50e-6 if share > 1.0 else 250e-6)


def layered(count, **more):
    """A ball on so many layers, and a wall on each of them."""
    walls = [
        {"name": f"w{k}", "fixed": True, "pose": [1.0, k, 0.0], "shapes": DISC["shapes"], "layers": [k + 1]}
        for k in range(count)
    ]
    ball = {"name": "ball", "mass": 0.1, "pose": [0.5, 0.5, 0.0], "velocity": [1, 0, 0], "shapes": DISC["shapes"]}
    return {"bodies": [{**ball, "layers": list(range(1, count + 1))}, *walls], **more}


def test_more_layers_than_impulse_has_bits_for_get_the_direct_solver_if_bodies_share_them():
    assert reason(**layered(LAYERS))[0] == "impulse"
    method, why = reason(**layered(LAYERS + 1))
    assert (method, why) == ("partitioned", "bodies share 33 layers, of which impulse takes at most 32")
    scene = layered(LAYERS + 1)
    scene["bodies"][0]["layers"] = [1, *range(100, 140)]  # which nobody else is on
    assert reason(**scene)[0] == "impulse"


def test_more_layers_than_any_method_takes_are_refused_before_anything_runs():
    with pytest.raises(ValueError, match="method is 'impulse', but bodies share 33 layers"):
        compiled(**layered(LAYERS + 1, method="impulse"))
    with pytest.raises(ValueError, match="share 90 layers, of which impulse takes at most 32, and the scene has"):
        compiled(**layered(90))


def test_an_error_that_no_step_keeps_is_said_and_one_that_is_kept_is_not():
    assert compiled(error=1e-5).unkept == ""  # in closed form
    bar = {"bodies": [BAR], "joints": [PINNED]}
    assert compiled(**bar, error=0.02).unkept == ""
    unkept = "error 1e-05 is wanted, and partitioned in steps of 0.025 ms may have a relative error of"
    assert unkept in compiled(**bar, error=1e-5).unkept
    asked = compiled(**bar, error=0.002, method="impulse").unkept
    assert asked == "error 0.002 is wanted; impulse holds 0.003; haptic scenes --verify measures the relative error"


def test_a_damper_counts_with_the_step_of_impulse_among_many_bodies_and_is_told_where_nothing_else_takes_them():
    plunger = {"name": "plunger", "mass": 0.01, "pose": [0.1, 0.0, 0.0], "shapes": [{"box": {"size": [0.02, 0.02]}}]}
    guide = {"type": "slider", "bodies": ["world", "plunger"], "at": [0.1, 0.05], "axis": [1.0, 0.0]}
    guide["damping"] = 0.5 * GREASE * 0.01 / SHORT
    for count, method, told in ((5, "impulse", False), (25, "partitioned", False), (45, "impulse", True)):
        others = [
            {"name": f"b{k}", "mass": 0.01, "pose": [1.0, k, 0.0], "velocity": [1, 0, 0], "shapes": DISC["shapes"]}
            for k in range(count)
        ]
        found = compiled(bodies=[plunger, *others], joints=[guide])
        assert found.method == method
        assert ("a damper holds a body back within" in found.unkept) == told
