# SPDX-License-Identifier: Apache-2.0
"""The least model: who moves, how freely, who can touch, what matters, and what the reduction leaves unchanged."""

import math

import numpy as np
import pytest

from bench.reference.case import NAMES as CASES
from bench.reference.trial import attempt
from haptic_device.config_files import names
from haptic_sim.method.closed_form import ClosedForm
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.measured import of_scene
from haptic_sim.reduction.method_choice import (
    EASY,
    GREASE,
    HIGH,
    HOLDS,
    LAYERS,
    LOAD,
    LONG,
    SHORT,
    SHORT_PER_BODY,
    STEPS,
    STIFFNESS,
    TOUCHING,
)
from haptic_sim.reduction.model import SPRING
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.language import SceneError, load, parse
from haptic_sim.verify import CREATED, OVERLAP, within

DISC = {"mass": 0.1, "pose": [0.5, 0.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
BAR = {"name": "bar", "mass": 1.0, "shapes": [{"box": {"size": [0.2, 0.02], "center": [0.1, 0.0]}}]}
STOP = {"name": "stop", "fixed": True, "shapes": [{"box": {"size": [0.02, 0.02]}}]}
WALL = {"name": "wall", "fixed": True, "shapes": [{"half_plane": {"normal": [1.0, 0.0]}}]}
PINNED = {"type": "pin", "bodies": ["world", "bar"], "at": [0.0, 0.0]}


def compiled(**parts):
    return reduce_scene(parse({"name": "test", "tool": DISC, **parts}, "here"))


def test_every_scene_compiles_to_finite_numbers_that_fit_at_a_step_that_divides_a_millisecond_and_was_measured():
    """`python -m bench chosen --out haptic_sim/reduction/measured.csv` measures the table of steps anew."""
    for name in names("scenes"):
        scene = load(name)
        reduced, rows = reduce_scene(scene), {row.method: row for row in of_scene(name)}
        model = reduced.model
        finite = [array for key, array in model._asdict().items() if key not in ("mass", "inertia", "joint_limit")]
        assert all(np.isfinite(array).all() for array in finite), name
        assert np.isfinite(model.mass).tolist() == [not fixed for fixed in model.fixed]
        assert (model.fixed[0], model.fixed[-1]) == (False, True), name
        assert len(reduced.shape_names) == len(model.shape_body) == len(model.shape_start) - 1
        assert 1e-3 / reduced.sub_step == pytest.approx(round(1e-3 / reduced.sub_step))
        assert all(reduced.reasons), name
        for kind, bodies, anchors in zip(model.joint_kind, model.joint_bodies, model.joint_anchor, strict=True):
            on = [turned(anchor, model.pose[body]) for body, anchor in zip(bodies, anchors, strict=True)]
            assert kind == SPRING or on[0] == pytest.approx(on[1], abs=1e-12), name
        assert (model.shape_body[model.pairs[:, 0]] < model.shape_body[model.pairs[:, 1]]).all()
        assert {"impulse", "partitioned", reduced.method} <= set(rows)
        for method, row in rows.items():
            assert row.step_us == pytest.approx(1e6 * reduce_scene(scene, method).sub_step), name
        assert within(rows[reduced.method], scene.error), name


def test_degrees_of_freedom_are_what_a_textbook_counts():
    """A four-bar has one, and its knob another; twelve of body coordinates less eight of four pins less two."""
    known = {"free_space": 3, "pendulum": 4, "slider": 2, "four_bar": 2, "stack": 18, "wrench_on_nut": 4}
    known["four_bar_singular"] = 2
    assert {name: reduce_scene(load(name)).needs.dof for name in known} == known


def test_what_joints_let_a_body_reach_it_may_touch_and_nothing_beyond():
    """A pin by the length of its bar, a chain of pins by the sum, a slider by its limits or anywhere."""
    elbow = {"type": "pin", "bodies": ["bar", "second"], "at": [0.2, 0.0]}
    rail = {"type": "slider", "bodies": ["world", "bar"], "at": [0.0, 0.0], "axis": [0.0, 1.0]}
    second = {**BAR, "name": "second", "pose": [0.2, 0.0, 0.0]}
    for who, where, touches, bodies, joints in (
        ("bar", 0.2102, True, [], [PINNED]),
        ("bar", 0.2103, False, [], [PINNED]),
        ("second", 0.39, True, [second], [PINNED, elbow]),
        ("second", 0.43, False, [second], [PINNED, elbow]),
        ("bar", 0.39, False, [second], [PINNED, elbow]),
        ("bar", 0.5, False, [], [rail | {"limits": [-0.1, 0.2]}]),
        ("bar", 0.5, True, [], [rail | {"limits": [-0.1, 0.3]}]),
        ("bar", 0.5, True, [], [rail]),
    ):
        needs = compiled(bodies=[BAR, *bodies, {**STOP, "pose": [0.0, where, 0.0]}], joints=joints).needs
        assert ((who, "stop") in needs.touching) == touches, (who, where)


def test_bodies_in_other_layers_or_held_together_do_not_touch():
    joined = {"type": "pin", "bodies": ["tool", "bar"], "at": [0.3, 0.0]}
    for more, touch in (({}, True), ({"joints": [joined]}, False), ({"joints": [joined | {"collide": True}]}, True)):
        assert (("tool", "bar") in compiled(bodies=[BAR], **more).needs.touching) == touch
    assert compiled(bodies=[{**BAR, "layers": [1]}]).needs.touching == ()


def test_a_body_that_nothing_can_move_is_taken_for_fixed():
    lonely = {**BAR, "layers": [1]}
    assert compiled(bodies=[lonely]).needs.at_rest == ("bar",)
    turning = PINNED | {"motor": {"speed": 1, "max_torque": 1}}
    moved = {"gravity": [0, -9.81]}, {"bodies": [{**lonely, "velocity": [0, 0, 1]}]}, {"joints": [turning]}
    for reason in (*moved, {"bodies": [BAR]}):
        assert compiled(**{"bodies": [lonely], **reason}).needs.moving == ("tool", "bar")


def test_welded_bodies_are_one_with_the_inertia_of_the_whole():
    half = {"mass": 1.0, "layers": [0], "shapes": [{"box": {"size": [1.0, 2.0]}}]}
    halves = [half | {"name": "left", "pose": [-0.5, 0, 0]}, half | {"name": "right", "pose": [0.5, 0, math.pi]}]
    weld = {"type": "weld", "bodies": ["left", "right"], "at": [0.0, 0.0]}
    whole = compiled(bodies=halves, joints=[weld], tool={**DISC, "pose": [3.0, 0.0, 0.0]})
    assert whole.model.mass[1] == 2.0 and whole.model.inertia[1] == pytest.approx(2.0 * (2.0**2 + 2.0**2) / 12)
    assert whole.places["right"].body == whole.places["left"].body == 1
    assert whole.places["right"].pose == pytest.approx((0.5, 0.0, math.pi))


@pytest.mark.parametrize(
    ("parts", "axes"),
    [
        ({}, ()),
        ({"bodies": [WALL]}, ((1.0, 0.0),)),
        ({"bodies": [WALL, {**WALL, "name": "floor", "pose": [0, -1, math.pi / 2]}]}, ((1.0, 0.0), (0.0, 1.0))),
        ({"bodies": [WALL, {**WALL, "name": "slant", "pose": [0, -1, 0.5]}]}, None),
        ({"bodies": [{**WALL, "material": "rough"}], "tool": {**DISC, "material": "rough"}}, None),
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


def test_the_sub_step_is_the_longest_whose_numerical_damping_is_the_error_stated():
    """Frequency 141 rad/s of 0.1 kg on 2000 N/m: 2 error / w is 0.283, 2.8, 0.057 ms."""
    for error, step in ((0.02, 0.25e-3), (0.2, 1e-3), (0.004, 0.05e-3), (1e-9, STEPS[-1])):
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
def test_mass_ratios_that_impulse_does_not_carry_get_the_direct_solver_where_bodies_touch_or_are_joined(share):
    expected = "partitioned" if share > 1.0 else "impulse"
    method, why = reason(**on_each_other(2, mass=2.0 / (share * LOAD)))
    assert method == expected
    assert ("b1 is" in why and "as heavy as b0, and 2 bodies stand on one another" in why) == (share > 1.0)
    speck = {**BAR, "name": "speck", "mass": 1.0 / (share * LOAD), "pose": [0.2, 0.0, 0.0], "layers": [2]}
    tied = {"type": "pin", "bodies": ["bar", "speck"], "at": [0.2, 0.0]}
    assert reason(bodies=[BAR, speck], joints=[PINNED, tied])[0] == expected
    assert reason(bodies=[BAR, speck], gravity=[0.0, -9.81])[0] == "impulse"
    method, why = reason(**on_each_other(2), error=HOLDS / share)
    assert (method, "is wanted; impulse holds" in why) == (expected, share > 1.0)
    light = {**DISC, "mass": STIFFNESS * (SHORT / 0.04) ** 2 / share}  # sqrt(2000 N/m / m) = 2 error / h
    method, why = reason(bodies=[{**BAR, "mass": 0.01}], tool=light)
    assert (method, "impulse cannot keep up with steps below 0.05 ms" in why) == (expected, share > 1.0)


def test_a_tower_is_carried_up_to_its_height_times_its_mass_ratio_and_up_to_a_height():
    for lowest, count, said in (
        (0.1, round(LOAD / 10.0), f": a load of {LOAD + 10:g},"),
        (1.0, HIGH, f", and impulse takes at most {HIGH}"),
    ):
        assert reason(**on_each_other(count, mass=lowest))[0] == "impulse"
        method, why = reason(**on_each_other(count + 1, mass=lowest))
        assert method == "partitioned" and f"{count + 1} bodies stand on one another{said}" in why


def test_bodies_beside_each_other_or_in_the_air_are_no_tower():
    tower = on_each_other(8, mass=0.1)
    assert reason(**tower)[0] == "partitioned"
    for x, lift in ((0.04, -0.02), (0.0, 1.1 * TOUCHING)):
        places = [[x * i, 0.01 + 0.02 * i + lift * (i + (lift > 0.0)), 0.0] for i in range(8)]
        apart = [{**block, "pose": place} for block, place in zip(tower["bodies"][1:], places, strict=True)]
        assert reason(**tower | {"bodies": [tower["bodies"][0], *apart]})[0] == "impulse"


def test_impulse_carries_the_load_that_it_is_said_to_and_not_many_times_as_much():
    """A block falls by 50 mm on one that stands; overlaps are measured with the shapes, energy by the ledger."""
    for times in (1.0, 30.0):
        parts = on_each_other(2, mass=1.0 / (times * LOAD))
        parts["bodies"][-1]["pose"] = [0.0, 0.08, 0.0]
        found = attempt(parse({"name": "test", **parts, "motion": {"name": "hold"}}, "here"), 0.3, "impulse")
        assert (found.overlap <= OVERLAP and found.created <= CREATED * found.scale) == (times == 1.0)


def test_what_is_more_than_the_direct_solver_takes_stays_with_impulse_and_says_so():
    method, why = reason(**on_each_other(40, mass=0.25))
    assert method == "impulse" and "40 bodies stand on one another" in why
    assert "the scene has 42 bodies; the compiled methods take at most 40" in why


def test_inside_a_sub_step_impulse_takes_half_of_what_the_error_allows_the_fastest_mode_but_no_extremes():
    """0.1 kg on 2000 N/m: error/141.4 1/s of the step is half of the error."""
    loose = {"bodies": [WALL, {**BAR, "mass": 0.1}]}
    for error, inside in ((0.02, LONG), (0.01, 0.01 / math.sqrt(STIFFNESS / 0.1)), (0.004, SHORT)):
        assert compiled(error=error, **loose).inside == pytest.approx(inside, rel=1e-12)
    assert compiled(**loose, joints=[PINNED]).inside == SHORT, "a joint"
    for share in (0.99, 1.01):  # a load that longer steps would let sink in
        found = compiled(tool=DISC | {"mass": 1.0}, bodies=[{**BAR, "mass": 1.0 / (share * EASY)}])
        assert found.inside == (LONG if share < 1.0 else SHORT)
    for count in (4, 20):
        short = max(SHORT, SHORT_PER_BODY * (count + 1))
        assert compiled(error=0.002, **on_each_other(count)).inside == pytest.approx(short)


def test_the_parameter_method_wins_over_what_the_scene_needs_or_asks_for_and_says_so():
    scene = parse({"name": "test", "tool": DISC, "bodies": [BAR], "method": "impulse"}, "here")
    found = reduce_scene(scene, "partitioned")
    assert (found.method, found.sub_step) == ("partitioned", SHORT)
    assert found.reasons[0] == "the parameter method asks for it"
    assert reduce_scene(scene).reasons[0] == "the scene asks for it"


def test_impulse_holds_the_error_that_it_is_said_to_in_every_scene_with_a_closed_form_or_stored_reference():
    rows = [row for name in CASES if name in names("scenes") for row in of_scene(name)]
    errors = [row.error for row in rows if row.method == "impulse"]
    assert len(errors) == 16 and 0.5 * HOLDS < max(errors) < HOLDS


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


@pytest.mark.parametrize("kind", ["slider", "pin", "spring"])
def test_a_damper_that_sweeps_do_not_settle_gets_the_direct_solver(kind):
    block = {"name": "block", "mass": 0.01, "inertia": 1e-6, "pose": [0.1, 0.0, 0.0], "shapes": STOP["shapes"]}
    joint = {
        "slider": {"type": "slider", "at": [0.1, 0.05], "axis": [1.0, 0.0]},
        "pin": {"type": "pin", "at": [0.1, 0.05]},
        "spring": {"type": "spring", "anchors": [[0.3, 0.0], [0.0, 0.0]]},
    }[kind] | {"bodies": ["world", "block"]}
    seen = 1e-6 if kind == "pin" else 0.01
    for share, expected in ((0.95, ("impulse", 250e-6)), (1.05, ("partitioned", 50e-6))):
        found = compiled(bodies=[block], joints=[joint | {"damping": share * GREASE * seen / SHORT}])
        assert (found.method, found.sub_step) == expected
        assert ("a damper holds a body back within" in found.reasons[0]) == (share > 1.0)


def layered(count, **more):
    """A ball on so many layers, and a wall on each of them."""
    walls = [
        {"name": f"w{k}", "fixed": True, "pose": [1.0, k, 0.0], "shapes": DISC["shapes"], "layers": [k + 1]}
        for k in range(count)
    ]
    ball = {"name": "ball", "mass": 0.1, "pose": [0.5, 0.5, 0.0], "velocity": [1, 0, 0], "shapes": DISC["shapes"]}
    return {"bodies": [{**ball, "layers": list(range(1, count + 1))}, *walls], **more}


def test_more_layers_than_impulse_has_bits_for_get_the_direct_solver_if_bodies_share_them_or_are_refused():
    assert reason(**layered(LAYERS))[0] == "impulse"
    method, why = reason(**layered(LAYERS + 1))
    assert (method, why) == ("partitioned", "bodies share 33 layers, of which impulse takes at most 32")
    scene = layered(LAYERS + 1)
    scene["bodies"][0]["layers"] = [1, *range(100, 140)]  # which nobody else is on
    assert reason(**scene)[0] == "impulse"
    with pytest.raises(ValueError, match="method is 'impulse', but bodies share 33 layers"):
        compiled(**layered(LAYERS + 1, method="impulse"))
