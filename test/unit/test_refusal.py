# SPDX-License-Identifier: Apache-2.0
"""Each way in which a scene or a device can be wrong, and the one sentence that says so."""

import copy

import pytest
from pydantic import ValidationError

from haptic_device import description
from haptic_device.refusal import SAID
from haptic_sim.scene import language

CIRCLE = {"circle": {"radius": 0.01}}
SCENE = {
    "name": "sample",
    "materials": {"steel": {"friction": 0.2}},
    "bodies": [{"name": "block", "mass": 1, "pose": [0.1, 0.0, 0], "shapes": [CIRCLE]}],
    "tool": {"mass": 0.1, "shapes": [CIRCLE]},
    "joints": [{"type": "pin", "bodies": ["world", "block"], "at": [0.1, 0.0]}],
    "measure": {"pushed": {"body": "block", "point": [0, 0], "axis": [2, 0], "from": 0.1, "to": 0.3}},
}
AXIS = {"counts_per_unit": 2e5, "motor_limit": 15.0, "workspace": [-0.1, 0.1], "velocity_limit": 3.0}
AXIS |= {"mass": 0.1, "damping": 3.0}
DEVICE = {"name": "sample", "axes": [{"name": name, **AXIS} for name in ("x", "y", "theta")]}
LEAST, MOST = (f"it should be {bound} than or equal to" for bound in ("greater", "less"))
MAPPED = "it should be a mapping of names to values"
TASK = {"title": "Push", "goal": "Push the block.", "done": {"pushed": 0.9}}
SPRING = {"type": "spring", "bodies": ["world", "block"], "anchors": [[0, 0], [0, 0]]}

SCENES = [
    (("tool", "mass"), 0, "tool.mass is 0: it should be greater than 0 kg"),
    (("tool", "mass"), None, "tool.mass is empty: it should be a number in kg"),
    (("tool", "mass"), [1.0], "tool.mass is [1.0]: it should be a number in kg"),
    (("tool", "mass"), {"kg": 1}, "tool.mass: it should be a number in kg"),
    (("tool", "mass"), "1:30", "tool.mass is '1:30': must be a number"),
    (("tool", "mass"), float("inf"), "tool.mass is inf: it should be a finite number in kg"),
    (("tool", "pose"), [0, 0], "tool.pose[2] is missing; add it"),
    (("tool", "pose"), [0, 0, 0, 0], "tool.pose is [0, 0, 0, 0]: it has 4 entries, and should have at most 3"),
    (("tool", "pose"), 1, "tool.pose is 1: it should be a list"),
    (("tool", "layers"), 1, "tool.layers is 1: it should be a list"),
    (("tool", "layers"), [0.5], "tool.layers[0] is 0.5: it should be a whole number"),
    (("tool", "layers"), ["a"], "tool.layers[0] is 'a': it should be a whole number"),
    (("tool", "layers"), [[1]], "tool.layers[0] is [1]: it should be a whole number"),
    (("tool", "shapes"), [], "tool.shapes: it has 0 entries, and should have at least 1"),
    (("tool", "shapes"), [{"disc": {}}], "tool.shapes[0]: must have exactly one of vertices, circle, box, half_plane"),
    (("tool",), 1, f"tool is 1: {MAPPED}"),
    (("materials",), [1], f"materials is [1]: {MAPPED}"),
    (("motion",), "circle", f"motion is 'circle': {MAPPED}"),
    (("bodies", 0, "fixed"), "perhaps", "bodies[0].fixed is 'perhaps': it should be true or false"),
    (("bodies", 0, "fixed"), [1], "bodies[0].fixed is [1]: it should be true or false"),
    (("bodies", 0, "name"), 1, "bodies[0].name is 1: it should be text"),
    (("materials", "steel", "friction"), -0.1, f"materials.steel.friction is -0.1: {LEAST} 0"),
    (("materials", "steel", "restitution"), 2, f"materials.steel.restitution is 2: {MOST} 1"),
    (("joints", 0, "type"), "hook", "joints[0].type is 'hook': it should be one of 'pin', 'slider', 'weld', 'spring'"),
    (("joints", 0), 1, f"joints[0] is 1: {MAPPED}"),
    (("joints", 0, "stiffness"), -1, f"joints[0].stiffness is -1: {LEAST} 0 N m/rad"),
    (("joints", 0), {**SPRING, "stiffness": -1.0}, f"joints[0].stiffness is -1.0: {LEAST} 0 N/m"),
    (("joints", 0, "motor"), {"speed": "x", "max_torque": 1}, "joints[0].motor.speed is 'x': must be a number"),
    (("method",), "euler", "method is 'euler': there is no such method; take one of "),
    (("task",), {**TASK, "title": ""}, "task.title is '': it should have a character at least"),
    (("task",), {**TASK, "hint": "x" * 201}, f"task.hint is '{'x' * 201}': it should have at most 200 characters"),
    (("tool", "mas"), 1, "tool: has no key 'mas'; did you mean 'mass'?"),
]
DEVICES = [
    (("axes", 0, "mass"), -1.0, "axes[0].mass is -1.0: it should be greater than 0 kg"),
    (("axes", 2, "mass"), -1.0, "axes[2].mass is -1.0: it should be greater than 0 kg m²"),
    (("axes", 2, "damping"), 2e9, f"axes[2].damping is 2000000000.0: {MOST} 1e+09 N m s/rad"),
    (("axes", 0, "mass"), "0.1", "axes[0].mass is '0.1': it should be a number in kg"),
    (("axes", 0, "mass"), True, "axes[0].mass is True: it should be a number in kg"),
    (("axes", 0, "motor_limit"), float("nan"), "axes[0].motor_limit is nan: it should be a finite number in N"),
    (("axes", 0, "workspace"), [0.1, -0.1], "axes[0].workspace is [0.1, -0.1]: write [low, high]"),
    (("axes", 0, "encoder_sign"), 2, "axes[0].encoder_sign is 2: it should be 1 or -1"),
    (("axes", 0, "name"), False, "axes[0].name is False: it should be 'x', 'y' or 'theta'"),
    (("axes",), [], "axes: it has 0 entries, and should have at least 1"),
    (("axes",), {}, "axes: it should be a list"),
    (("axes", 1), "y", f"axes[1] is 'y': {MAPPED}"),
    (("sensing_delay",), 0.2, "sensing_delay is 0.2: it should be less than or equal to 0.1 s"),
    (("gravity_compensation",), 3, "gravity_compensation is 3: it should be true or false"),
    (("drag_sensor",), {"noise": -1.0}, "drag_sensor.noise is -1.0: it should be greater than or equal to 0 N or N m"),
    (("homing",), "never", "homing is 'never': it should be 'absolute' or 'at_start'"),
    (("axes", 0, "dampin"), 3.0, "axes[0]: has no key 'dampin'; did you mean 'damping'?"),
    (("axes", 2, "mass"), 1e-7, "axes[2]: damping/mass is 3e+07 1/s; the limit is 20000 1/s"),
]


def changed(content, path, value):
    content = copy.deepcopy(content)
    *folders, last = path
    inside = content
    for part in folders:
        inside = inside[part]
    inside[last] = value
    return content


def refused(parse, content):
    with pytest.raises(ValueError) as refusal:
        parse(content, "FILE")
    return str(refusal.value)


@pytest.mark.parametrize(("path", "value", "sentence"), SCENES)
def test_a_wrong_scene_is_refused_with_name_value_limit_and_unit(path, value, sentence):
    assert refused(language.parse, changed(SCENE, path, value)).startswith(f"FILE: {sentence}")


@pytest.mark.parametrize(("path", "value", "sentence"), DEVICES)
def test_a_wrong_device_is_refused_with_name_value_limit_and_unit(path, value, sentence):
    assert refused(description.parse, changed(DEVICE, path, value)).startswith(f"FILE: {sentence}")


def kinds(model, content):
    try:
        model.model_validate(content)
    except ValidationError as errors:
        return {error["type"] for error in errors.errors()}
    raise AssertionError("it is taken")


def test_each_kind_of_refusal_that_has_words_stands_in_these_tables_and_no_other_is_without():
    scenes = [kinds(language.Scene, changed(SCENE, path, value)) for path, value, _ in SCENES]
    devices = [kinds(description.Device, changed(DEVICE, path, value)) for path, value, _ in DEVICES]
    found = set().union(*scenes, *devices)
    own_words = {"value_error", "missing", "extra_forbidden", "union_tag_not_found", "shape"}
    assert set(SAID) <= found <= set(SAID) | own_words
