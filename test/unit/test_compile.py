# SPDX-License-Identifier: Apache-2.0
"""The least model: who moves, how freely, who can touch, what matters, and what the reduction leaves unchanged."""

import math

import numpy as np
import pytest

from haptic_device.config.files import names
from haptic_sim.lockstep.verify import within
from haptic_sim.reduction import reduce_scene
from haptic_sim.reduction.measured import of_scene
from haptic_sim.reduction.method_choice import GREASE, HOLDS, LOAD, SHORT, STEPS, STIFFNESS, TOUCHING
from haptic_sim.reduction.model import SPRING
from haptic_sim.scene.geometry import turned
from haptic_sim.scene.language import load, parse

DISC = {"mass": 0.1, "pose": [0.5, 0.0, 0.0], "shapes": [{"circle": {"radius": 0.01}}]}
BAR = {"name": "bar", "mass": 1.0, "shapes": [{"box": {"size": [0.2, 0.02], "center": [0.1, 0.0]}}]}
STOP = {"name": "stop", "fixed": True, "shapes": [{"box": {"size": [0.02, 0.02]}}]}
WALL = {"name": "wall", "fixed": True, "shapes": [{"half_plane": {"normal": [1.0, 0.0]}}]}
PINNED = {"type": "pin", "bodies": ["world", "bar"], "at": [0.0, 0.0]}


def compiled(**parts):
    return reduce_scene(parse({"name": "test", "tool": DISC, **parts}, "here"))


def test_every_scene_compiles_to_finite_numbers_at_a_step_that_was_measured_within_its_error():
    """`python -m bench chosen --out haptic_sim/reduction/measured.csv` measures the table of steps anew."""
    for name in names("scenes"):
        scene = load(name)
        reduced, rows = reduce_scene(scene), {row.method: row for row in of_scene(name)}
        model = reduced.model
        finite = [one for key, one in vars(model).items() if key not in ("record", "mass", "inertia", "joint_limit")]
        assert all(np.isfinite(array).all() for array in finite), name
        assert np.isfinite(model.mass).tolist() == [not fixed for fixed in model.fixed]
        assert 1e-3 / reduced.sub_step == pytest.approx(round(1e-3 / reduced.sub_step))
        for kind, bodies, anchors in zip(model.joint_kind, model.joint_bodies, model.joint_anchor, strict=True):
            on = [turned(anchor, model.pose[body]) for body, anchor in zip(bodies, anchors, strict=True)]
            assert kind == SPRING or on[0] == pytest.approx(on[1], abs=1e-12), name
        assert {"impulse", "partitioned", reduced.method} <= set(rows)
        for method, row in rows.items():
            assert row.step_us == pytest.approx(1e6 * reduce_scene(scene, method).sub_step), name
        assert within(rows[reduced.method], scene.error), name


def test_degrees_of_freedom_are_what_a_textbook_counts():
    """A four-bar has one, and its knob another; twelve of body coordinates less eight of four pins less two."""
    known = {"free_space": 3, "pendulum": 4, "slider": 2, "four_bar": 2, "four_bar_singular": 2, "stack": 18}
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
        ("bar", 0.5, False, [], [rail | {"limits": [-0.1, 0.2]}]),
        ("bar", 0.5, True, [], [rail]),
    ):
        needs = compiled(bodies=[BAR, *bodies, {**STOP, "pose": [0.0, where, 0.0]}], joints=joints).needs
        assert ((who, "stop") in needs.touching) == touches, (who, where)


def test_bodies_in_other_layers_or_held_together_do_not_touch_and_one_that_nothing_can_move_is_taken_for_fixed():
    joined, lonely = {"type": "pin", "bodies": ["tool", "bar"], "at": [0.3, 0.0]}, {**BAR, "layers": [1]}
    for more, touch in (({}, True), ({"joints": [joined]}, False), ({"joints": [joined | {"collide": True}]}, True)):
        assert (("tool", "bar") in compiled(bodies=[BAR], **more).needs.touching) == touch
    needs = compiled(bodies=[lonely]).needs
    assert (needs.touching, needs.at_rest) == ((), ("bar",))
    turning = PINNED | {"motor": {"speed": 1, "max_torque": 1}}
    for reason in ({"gravity": [0, -9.81]}, {"bodies": [{**lonely, "velocity": [0, 0, 1]}]}, {"joints": [turning]}):
        assert compiled(**{"bodies": [lonely], **reason}).needs.moving == ("tool", "bar")


def test_welded_bodies_are_one_with_the_inertia_of_the_whole():
    half = {"mass": 1.0, "layers": [0], "shapes": [{"box": {"size": [1.0, 2.0]}}]}
    halves = [half | {"name": "left", "pose": [-0.5, 0, 0]}, half | {"name": "right", "pose": [0.5, 0, math.pi]}]
    weld = {"type": "weld", "bodies": ["left", "right"], "at": [0.0, 0.0]}
    whole = compiled(bodies=halves, joints=[weld], tool={**DISC, "pose": [3.0, 0.0, 0.0]})
    assert whole.model.mass[1] == 2.0 and whole.model.inertia[1] == pytest.approx(2.0 * (2.0**2 + 2.0**2) / 12)
    assert whole.places["right"].pose == pytest.approx((0.5, 0.0, math.pi))


def test_only_a_round_tool_among_smooth_square_walls_has_a_closed_form_and_one_wished_for_elsewhere_is_refused():
    def axes(*walls, **tool):
        walls = [{**WALL, "name": f"w{k}"} | wall for k, wall in enumerate(walls)]
        return compiled(bodies=walls, tool=DISC | tool, materials={"rough": {"friction": 0.1}}).needs.axes

    assert (axes(), axes({})) == ((), ((1.0, 0.0),))
    assert axes({}, {"pose": [0, -1, math.pi / 2]})[1] == pytest.approx((0.0, 1.0))
    assert axes({}, {"pose": [0, -1, 0.5]}) is axes({"material": "rough"}, material="rough") is None
    assert (
        axes({}, shapes=STOP["shapes"]) is axes({}, shapes=[{"circle": {"radius": 0.01, "center": [0, 0.01]}}]) is None
    )
    with pytest.raises(ValueError, match="'closed_form', which needs a round tool"):
        compiled(method="closed_form", bodies=[BAR])


def test_the_sub_step_is_the_longest_whose_numerical_damping_is_the_error_stated():
    """Frequency 141 rad/s of 0.1 kg on 2000 N/m: 2 error / w is 0.283, 2.8, 0.057 ms."""
    for error, step in ((0.02, 0.25e-3), (0.2, 1e-3), (0.004, 0.05e-3), (1e-9, STEPS[-1])):
        assert compiled(error=error).sub_step == step


def on_each_other(count, **lowest):
    """So many blocks of 1 kg on a floor, the first as told."""
    block = {"mass": 1.0, "shapes": [{"box": {"size": [0.04, 0.02]}}]}
    blocks = [{**block, "name": f"b{i}", "pose": [0.0, 0.01 + 0.02 * i, 0.0]} for i in range(count)]
    floor = {"name": "floor", "fixed": True, "shapes": [{"half_plane": {"normal": [0.0, 1.0]}}]}
    bodies = [floor, blocks[0] | lowest, *blocks[1:]]
    return {"gravity": [0.0, -9.81], "bodies": bodies, "tool": {**DISC, "mass": 1.0, "pose": [0.5, 0.5, 0.0]}}


def reason(**parts):
    """(method, why) of a scene."""
    found = compiled(**parts)
    return found.method, found.reasons[0]


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_mass_ratios_that_impulse_does_not_carry_get_the_direct_solver_where_bodies_touch_or_are_joined(share):
    expected = "partitioned" if share > 1.0 else "impulse"
    assert reason(**on_each_other(2, mass=2.0 / (share * LOAD)))[0] == expected
    speck = {**BAR, "name": "speck", "mass": 1.0 / (share * LOAD), "pose": [0.2, 0.0, 0.0], "layers": [2]}
    tied = {"type": "pin", "bodies": ["bar", "speck"], "at": [0.2, 0.0]}
    assert reason(bodies=[BAR, speck], joints=[PINNED, tied])[0] == expected
    assert reason(bodies=[BAR, speck], gravity=[0.0, -9.81])[0] == "impulse"
    assert reason(**on_each_other(2), error=HOLDS / share)[0] == expected
    light = {**DISC, "mass": STIFFNESS * (SHORT / 0.04) ** 2 / share}  # sqrt(2000 N/m / m) = 2 error / h
    assert reason(bodies=[{**BAR, "mass": 0.01}], tool=light)[0] == expected


def test_a_tower_is_carried_up_to_its_height_times_its_mass_ratio_and_up_to_a_height_and_bodies_apart_are_none():
    for lowest, count, said in ((0.1, 6, "7 bodies stand on one another: a load of 70,"), (1.0, 15, "at most 15")):
        assert reason(**on_each_other(count, mass=lowest))[0] == "impulse"
        method, why = reason(**on_each_other(count + 1, mass=lowest))
        assert method == "partitioned" and said in why
    method, why = reason(**on_each_other(40, mass=0.25))
    assert method == "impulse" and "the scene has 42 bodies; the compiled methods take at most 40" in why
    tower = on_each_other(8, mass=0.1)
    for x, lift in ((0.04, -0.02), (0.0, 1.1 * TOUCHING)):  # beside each other, in the air
        places = [[x * i, 0.01 + 0.02 * i + lift * (i + (lift > 0.0)), 0.0] for i in range(8)]
        apart = [{**block, "pose": place} for block, place in zip(tower["bodies"][1:], places, strict=True)]
        assert reason(**tower | {"bodies": [tower["bodies"][0], *apart]})[0] == "impulse"


def test_the_parameter_method_wins_over_what_the_scene_needs_or_asks_for_and_says_so():
    scene = parse({"name": "test", "tool": DISC, "bodies": [BAR], "method": "impulse"}, "here")
    found = reduce_scene(scene, "partitioned")
    assert (found.method, found.sub_step) == ("partitioned", SHORT)
    assert found.reasons[0] == "the parameter method asks for it"
    assert reduce_scene(scene).reasons[0] == "the scene asks for it"


def test_a_damper_that_sweeps_do_not_settle_gets_the_direct_solver():
    block = {"name": "block", "mass": 0.01, "inertia": 1e-6, "pose": [0.1, 0.0, 0.0], "shapes": STOP["shapes"]}
    for seen, joint in (
        (0.01, {"type": "slider", "at": [0.1, 0.05], "axis": [1.0, 0.0]}),
        (1e-6, {"type": "pin", "at": [0.1, 0.05]}),
        (0.01, {"type": "spring", "anchors": [[0.3, 0.0], [0.0, 0.0]]}),
    ):
        for share, expected in ((0.95, ("impulse", 250e-6)), (1.05, ("partitioned", 50e-6))):
            damped = joint | {"bodies": ["world", "block"], "damping": share * GREASE * seen / SHORT}
            found = compiled(bodies=[block], joints=[damped])
            assert (found.method, found.sub_step) == expected


def test_more_layers_than_impulse_has_bits_for_get_the_direct_solver_or_are_refused():
    def layered(count, **more):
        fixed = {"fixed": True, "shapes": DISC["shapes"]}
        walls = [{**fixed, "name": f"w{k}", "pose": [1.0, k, 0.0], "layers": [k + 1]} for k in range(count)]
        ball = {**BAR, "pose": [0.5, 0.5, 0.0], "velocity": [1, 0, 0], "layers": list(range(1, count + 1))}
        return {"bodies": [ball, *walls], **more}

    assert reason(**layered(32))[0] == "impulse"
    assert reason(**layered(33)) == ("partitioned", "bodies share 33 layers, of which impulse takes at most 32")
    with pytest.raises(ValueError, match="method is 'impulse', but bodies share 33 layers"):
        compiled(**layered(33, method="impulse"))
