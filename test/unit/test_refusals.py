# SPDX-License-Identifier: Apache-2.0
"""What may be wrong in a scene or a device, the one sentence that says so, and what is taken just inside of a bound.

A row: where, the wrong value (... leaves it out), the sentence, and values that are right. Of commands: see
test_refused_commands.py; of parameters: test_parameter.py; of texts that are no YAML: test_yaml_reader.py.
"""

import re
from math import inf, nan

import pytest
from sample_files import DEVICE, SCENE, changed

from haptic_device.config import description
from haptic_sim.scene import language

PLANE = {"half_plane": {"normal": [0, 1]}}
HELD = {"bodies": ["world", "block"], "at": [0.0, 0.0]}
SLIDER = SCENE | {"joints": [{**HELD, "type": "slider", "axis": [0, 1], "motor": {"speed": 1, "max_force": 2}}]}
SPRING = SCENE | {"joints": [{**HELD, "type": "spring", "stiffness": 1, "rest": 0}]}
APART = "joints[0] cannot be met: its anchors on 'world' and 'block' are"


def waypoints(second):
    return {"name": "waypoints", "waypoints": [[0.0, 0.0], second]}


def apart(x, y):
    """A pin whose anchors are apart by this [m]."""
    return {"type": "pin", "bodies": ["world", "block"], "anchors": [[0.1, 0.02], [x, 0.02 + y]]}


ON_SERIAL = DEVICE | {"link": {"type": "serial", "port": "/dev/a"}}
ON_UDP = DEVICE | {"link": {"type": "udp", "port": 5}}
MOTEUS = DEVICE | {"link": {"type": "moteus", "port": "/dev/a", "ids": [1, 2, 3]}}

MORE, LEAST, MOST = (
    f"it should be {word}" for word in ("greater than", "greater than or equal to", "less than or equal to")
)
MAPPED, FINITE = "it should be a mapping of names to values", "it should be a finite number"
LISTED, WHOLE, TRUTH = "it should be a list", "it should be a whole number", "it should be true or false"
FEW, TURNS = "in the workspace; at least 100 counts in it are needed", "the limit is ±25.13 rad (not degrees)"
KINDS = "one of loopback, shared_memory, serial, udp, haply, moteus"

IN_A_SCENE = [
    ("tool.mass", 0, f"tool.mass is 0: {MORE} 0 kg", 1e-9),
    ("tool.mass", ..., "tool.mass is missing; add it"),
    ("tool.mass", None, "tool.mass is empty: it should be a number in kg"),
    ("tool.mass", True, "tool.mass is True: must be a number"),
    ("tool.mass", "1:30", "tool.mass is '1:30': must be a number"),
    ("tool.mass", inf, f"tool.mass is inf: {FINITE} in kg"),
    ("tool.mass", {"kg": 1}, "tool.mass: it should be a number in kg"),
    ("tool.mas", 1, "tool: has no key 'mas'; did you mean 'mass'?"),
    ("tool.pose", [0, 0], "tool.pose[2] is missing; add it", [0, 0.5, 0]),
    ("tool.pose", [0, 0, 0, 0], "tool.pose is [0, 0, 0, 0]: it should have at most 3 items and has 4"),
    ("tool.pose", 1, f"tool.pose is 1: {LISTED}"),
    ("tool.pose", [0, 0.005, 0], "bodies[0] ('table') overlaps tool ('tool') by 5 mm at the start; move one of them"),
    ("tool.pose", [0, 0.01 - 2e-9, 0], "bodies[0] ('table') overlaps", [0, 0.01 - 0.5e-9, 0], [0, 0.01, 0]),
    ("tool.layers", [0.5], f"tool.layers[0] is 0.5: {WHOLE}", [1]),
    ("tool.layers", ["a"], f"tool.layers[0] is 'a': {WHOLE}"),
    ("tool.layers", [[1]], f"tool.layers[0] is [1]: {WHOLE}"),
    ("tool.layers", 1, f"tool.layers is 1: {LISTED}"),
    ("tool.shapes", [], "tool.shapes: it should have at least 1 item and has 0"),
    ("tool.shapes.0", {"disc": {}}, "tool.shapes[0]: must have exactly one of vertices, circle, box, half_plane"),
    ("tool.shapes.0", PLANE, "tool: has a half_plane, which only a fixed body can have; take a box"),
    ("tool.shapes.0.circle.radius", 0, f"tool.shapes[0].circle.radius is 0: {MORE} 0 m", 1e-9),
    ("tool.shapes.0.circle.radios", 1, "tool.shapes[0].circle: has no key 'radios'; did you mean 'radius'?"),
    ("bodies.0.shapes.0.box.size", [1, 0], f"bodies[0].shapes[0].box.size[1] is 0: {MORE} 0 m", [1, 1e-6]),
    ("tool.surface_velocity", [1, 0], "tool: has no key 'surface_velocity'"),
    ("tool", 1, f"tool is 1: {MAPPED}"),
    ("materials.steel", 1, f"materials.steel is 1: {MAPPED}"),
    ("materials.steel.friction", -0.1, f"materials.steel.friction is -0.1: {LEAST} 0", 0),
    ("materials.steel.restitution", 1.01, f"materials.steel.restitution is 1.01: {MOST} 1", 1),
    ("bodies.0.fixed", "perhaps", f"bodies[0].fixed is 'perhaps': {TRUTH}"),
    ("bodies.0.fixed", [1], f"bodies[0].fixed is [1]: {TRUTH}"),
    ("bodies.0.velocity", [1, 0, 0], "bodies[0]: is fixed, so its velocity cannot be [1.0, 0.0, 0.0]", [0, 0, 0]),
    ("bodies.0.surface_velocity", [inf, 0], f"bodies[0].surface_velocity[0] is inf: {FINITE}", [1, 0]),
    ("bodies.0.shapes.0", {"half_plane": {"normal": [0, 0]}}, "bodies[0].shapes[0].half_plane.normal is [0, 0]: must"),
    ("bodies.0.name", 1, "bodies[0].name is 1: it should be text"),
    ("bodies.0.name", "tool", "bodies[0].name is 'tool', which is taken; give each body its own"),
    ("bodies.0.name", "world", "bodies[0].name is 'world', which is taken; give each body its own"),
    ("bodies.0.name", "block", "bodies[1].name is 'block', which is taken; give each body its own"),
    ("bodies.1.mass", ..., "bodies[1]: needs a mass in kg, or fixed: true"),
    ("bodies.1.mass", -1, f"bodies[1].mass is -1: {MORE} 0 kg"),
    ("bodies.1.pose", [0, inf, 0], f"bodies[1].pose[1] is inf: {FINITE}"),
    ("bodies.1.pose", [0.1, -0.001, 0], "bodies[1] ('block') overlaps bodies[0] ('table') by 1 mm"),
    ("bodies.1.velocity", [0, 2, 0], "joints[0] ('hinge') is pulled apart at 2 m/s by the", [0.03, -0.03, 3.0]),
    ("bodies.1.material", "steal", "bodies[1].material is 'steal'; materials has steel", "steel"),
    ("bodies.1.surface_velocity", [1, 0], "bodies[1]: has the surface_velocity [1.0, 0.0] m/s, which only a fixed"),
    ("bodies.1.shapes.0", PLANE, "bodies[1]: has a half_plane, which only a fixed body can have; write fixed: true"),
    ("joints.0", 1, f"joints[0] is 1: {MAPPED}"),
    ("joints.0.type", "hook", "joints[0]: type is 'hook'; it should be one of 'pin', 'slider', 'weld', 'spring'"),
    ("joints.0", {**HELD, "type": "weld", "bodies": ["tool", "block"]}, "joints[0] welds 'tool' and 'block'; give"),
    ("joints.0", apart(0.003, 0.004), f"{APART} 5 mm apart at the start, by [0.003, 0.004] m; move a body"),
    ("joints.0", apart(1.1e-6, 0.0), f"{APART} 0.0011 mm apart", apart(0.9e-6, 0.0)),
    ("joints.0.type", ..., "joints[0]: type is missing; add it"),
    ("joints.0.bodies", ["world", "blok"], "joints[0] ('hinge').bodies[1] is 'blok'; it must be one of tool, table"),
    ("joints.0.bodies", ["table", "world"], "joints[0] ('hinge') joins two bodies that cannot move, 'table'"),
    ("joints.0.bodies", ["block", "block"], "joints[0]: joins 'block' to itself; name two bodies"),
    ("joints.0.at", ..., "joints[0]: needs exactly one of at (a point of the plane) and anchors"),
    ("joints.0.at", [nan, 0], f"joints[0].at[0] is nan: {FINITE}"),
    ("joints.0.axis", [1, 0], "joints[0]: has no key 'axis'; known here are name, bodies, at, anchors"),
    ("joints.0.limit", [-1, 1], "joints[0]: has no key 'limit'; did you mean 'limits'?"),
    ("joints.0.limits", [0.5, 1], "joints[0].limits is [0.5, 1]: must enclose 0, which is where the joint", [0, 1]),
    ("joints.0.limits", [0.0, -0.4], "joints[0].limits is [0.0, -0.4]: the smaller limit stands first", [-0.4, 0]),
    ("joints.0.friction_torque", -1, f"joints[0].friction_torque is -1: {LEAST} 0 N m", 0),
    ("joints.0.stiffness", -1, f"joints[0].stiffness is -1: {LEAST} 0 N m/rad", 0),
    ("joints.0.motor", {"speed": 1, "max_torque": 0}, f"joints[0].motor.max_torque is 0: {MORE} 0 N m"),
    ("joints.0.motor", {"speed": "x", "max_torque": 1}, "joints[0].motor.speed is 'x': must be a number"),
    ("joints.0.motor", {"speed": 1, "max_force": 2}, "joints[0].motor: has no key 'max_force'; did you mean 'max_tor"),
    ("joints.0.motor", {"speed": 1}, "joints[0].motor.max_torque is missing; add it", {"speed": 1, "max_torque": 1e-9}),
    ("measure.pushed.axis", [0, 0], "measure.pushed.axis is [0, 0]: must have some length"),
    ("measure.pushed.body", "blok", "measure.pushed.body is 'blok'; it must be one of tool, table, block", "tool"),
    ("measure.pushed.from", "far", "measure.pushed.from is 'far': must be a number"),
    ("measure.pushed.to", 0.1, "measure.pushed: needs from and to that differ", 0.2),
    ("task.title", ..., "task.title is missing; add it"),
    ("task.title", "", "task.title is '': it should have at least 1 character"),
    ("task.hint", "x" * 201, f"task.hint is '{'x' * 201}': it should have at most 200 characters", "x" * 200),
    ("task.goal", 3, "task.goal is 3: it should be text"),
    ("task.hints", "no", "task: has no key 'hints'; did you mean 'hint'?"),
    ("task.done", {"pushd": 0.9}, "task.done.pushd is the fraction of no measure; measure has pushed"),
    ("task.done", {"pushed": 0}, f"task.done.pushed is 0: {MORE} 0", {"pushed": 1e-9}),
    ("task.done", {"pushed": 1.001}, f"task.done.pushed is 1.001: {MOST} 1", {"pushed": 1}),
    ("task.done", {}, "task: needs done (measure: least fraction) or force in N"),
    ("task.force", 0, f"task.force is 0: {MORE} 0 N", 1e-3),
    ("task.words", "far", "task.words is 'far': write {percent} once"),
    ("task.words", "{percent} of {percent}", "task.words is '{percent} of {percent}': write {percent} once"),
    ("task.way", [[0, 0]], "task.way[0][2] is missing"),
    ("task.way", [[0, 0, 0]] * 32, "task.way: it should have at most 31 items and has 32", [[0, 0, 0]] * 31),
    ("task.seconds", 0, f"task.seconds is 0: {MORE} 0 s", 1e-3),
    ("motion", "circle", f"motion is 'circle': {MAPPED}"),
    ("motion", waypoints([0.1]), "motion: waypoints[1] is [0.1]; write [x, y] or [x, y, theta]", waypoints([0.1, 0.2])),
    ("motion", waypoints([0, 0, 0, 0]), "motion: waypoints[1] is [0, 0, 0, 0]; write [x, y]", waypoints([0, 0, 0])),
    ("motion", waypoints(0.1), "motion: waypoints[1] is 0.1; write [x, y]"),
    ("method", "euler", "method is 'euler': there is no such method; take one of impulse, penalty_ex", "impulse"),
    ("sub_step", 0, f"sub_step is 0: {MORE} 0 s", 1e-5),
    ("error", nan, f"error is nan: {FINITE}", 1.0),
    ("name", ..., "name is missing; add it"),
    ("graviti", [0, 0], "has no key 'graviti'; did you mean 'gravity'?"),
]
ASIDE = SLIDER["joints"][0] | {"at": None, "anchors": [[0.1, 0.0], [0.003, 1]]}
ON_A_SLIDER = [
    ("joints.0.axis", ..., "joints[0].axis is missing; add it"),
    ("joints.0.motor.max_force", 0, f"joints[0].motor.max_force is 0: {MORE} 0 N", 1e-9),
    ("joints.0.motor.max_torque", 1, "joints[0].motor: has no key 'max_torque'; did you mean 'max_force'?"),
    ("joints.0.friction_force", -1, f"joints[0].friction_force is -1: {LEAST} 0 N", 0),
    ("joints.0.stiffness", -1.0, f"joints[0].stiffness is -1.0: {LEAST} 0 N/m", 0),
    ("joints.0", ASIDE, f"{APART} 3 mm apart at the start"),
]
ON_A_SPRING = [
    ("joints.0.stiffness", 0, "joints[0]: a spring needs a stiffness in N/m or a damping in N s/m"),
    ("joints.0.stiffness", -1.0, f"joints[0].stiffness is -1.0: {LEAST} 0 N/m", 1e-9),
    ("joints.0.motor", {"speed": 1, "max_force": 2}, "joints[0]: has no key 'motor'; known here are name, bodies, at"),
    ("joints.0.rest", -1, f"joints[0].rest is -1: {LEAST} 0 m", 0),
    ("joints.0.rest", ..., "joints[0] has no length and so no direction; write rest: 0 or move an anchor"),
]
IN_A_DEVICE = [
    ("axes.0.mass", 0.0, f"axes[0].mass is 0.0: {MORE} 0 kg", 0.001),
    ("axes.2.mass", -1.0, f"axes[2].mass is -1.0: {MORE} 0 kg m²"),
    ("axes.0.mass", "0.1", "axes[0].mass is '0.1': it should be a number in kg", 1),
    ("axes.0.mass", True, "axes[0].mass is True: it should be a number in kg"),
    ("axes.2.mass", 1e-7, "axes[2]: damping/mass is 3e+07 1/s; the limit is 20000 1/s"),
    ("axes.0.damping", 2000.1, "axes[0]: damping/mass is 20001 1/s; the limit is 20000 1/s", 2000.0),
    ("axes.2.damping", 2e9, f"axes[2].damping is 2000000000.0: {MOST} 1000000000 N m s/rad"),
    ("axes.0.counts_per_unit", 0.0, f"axes[0].counts_per_unit is 0.0: {MORE} 0 counts/m"),
    ("axes.0.counts_per_unit", 499.0, f"axes[0]: counts_per_unit is 499 counts/m, 99.8 {FEW}", 500.0, 501.0),
    ("axes.2.counts_per_unit", 1.0, f"axes[2]: counts_per_unit is 1 counts/rad, 0.2 {FEW}", 500.0),
    ("axes.1.workspace", [0.0, 0.00049], f"axes[1]: counts_per_unit is 200000 counts/m, 98 {FEW}", [0.0, 0.00051]),
    (
        "axes.0.workspace",
        [-100.0, 100.0],
        "axes[0]: workspace is [-100, 100] m; the limit is ±5 m (not mm)",
        [-5.0, 5.0],
    ),
    ("axes.0.workspace", [-5.001, 0.0], "axes[0]: workspace is [-5.001, 0] m; the limit is ±5 m (not mm)"),
    ("axes.1.workspace", [4.0, 5.001], "axes[1]: workspace is [4, 5.001] m; the limit is ±5 m (not mm)", [4.0, 5.0]),
    ("axes.2.workspace", [-30.0, 30.0], f"axes[2]: workspace is [-30, 30] rad; {TURNS}", [-25.13, 25.13]),
    ("axes.2.workspace", [0.0, 25.14], f"axes[2]: workspace is [0, 25.14] rad; {TURNS}", [0.0, 25.13]),
    ("axes.0.motor_limit", nan, f"axes[0].motor_limit is nan: {FINITE} in N"),
    ("axes.0.workspace", [0.1, -0.1], "axes[0].workspace is [0.1, -0.1]: write [low, high]"),
    ("axes.0.workspace", [0.1], "axes[0].workspace[1] is missing; add it"),
    ("axes.0.encoder_sign", 2, "axes[0].encoder_sign is 2: it should be 1 or -1", -1),
    ("axes.0.name", False, "axes[0].name is False: it should be 'x', 'y' or 'theta'"),
    ("axes.0.name", "y", "axes are y, y, theta; write x, or x and y, or x, y and theta"),
    ("axes.0.dampin", 3.0, "axes[0]: has no key 'dampin'; did you mean 'damping'?"),
    ("axes.0.velocity_limit", ..., "axes[0].velocity_limit is missing; add it"),
    ("axes.1", "y", f"axes[1] is 'y': {MAPPED}"),
    ("axes", [], "axes: it should have at least 1 item and has 0", DEVICE["axes"][:1]),
    ("axes", {}, f"axes: {LISTED}"),
    ("axes", DEVICE["axes"] * 2, "axes: it should have at most 3 items and has 6", DEVICE["axes"][:2]),
    ("sensing_delay", 0.1001, f"sensing_delay is 0.1001: {MOST} 0.1 s", 0.1),
    ("actuation_delay", -0.001, f"actuation_delay is -0.001: {LEAST} 0 s", 0.0),
    ("actuation_delay", 0.0401, f"actuation_delay is 0.0401: {MOST} 0.04 s", 0.04),
    ("gravity", [0.0], "gravity[1] is missing; add it"),
    ("gravity_compensation", 3, f"gravity_compensation is 3: {TRUTH}"),
    ("scale", [0.0, 1.0], f"scale[0] is 0.0: {MORE} 0", [0.1, 1.0]),
    ("drag_sensor", {"noise": -1.0}, f"drag_sensor.noise is -1.0: {LEAST} 0 N or N m", {"noise": 0.0}),
    ("homing", "never", "homing is 'never': it should be 'absolute' or 'at_start'", "absolute"),
    ("sensing_dely", 0.0, "has no key 'sensing_dely'; did you mean 'sensing_delay'?"),
    ("link", "serial", "link is 'serial': it should be a mapping such as {type: serial, port: /dev"),
    ("link", {"port": "/dev/a"}, f"link: type is missing; write {KINDS}"),
    ("link", {"type": "usb"}, f"link: type is 'usb'; it should be {KINDS}"),
    ("link", {"type": ["serial"]}, f"link: type is ['serial']; it should be {KINDS}"),
    ("link", {"type": "loopback", "port": 1}, "link: type loopback has no key 'port'", {"type": "loopback"}),
    ("link", {"type": "shared_memory", "baud": 1}, "link: type shared_memory has no key 'baud'"),
]
ON_A_SERIAL_LINE = [
    ("link.port", ..., "link: port is missing; add it"),
    ("link.port", 3, "link: port is 3: it should be text"),
    ("link.port", "", "link: port is '': it should have at least 1 character"),
    ("link.speed", 1, "link: has no key 'speed'; known here are port, baud, program"),
    ("link.baud", 0, "link: baud is 0: it should be one of 1200, 1800, 2400, 4800, 9600, ", 1200),
    ("link.baud", 600, "link: baud is 600: it should be one of 1200, ", 1800),
    ("link.baud", 250_000, "link: baud is 250000: it should be one of 1200, ", 230_400, 460_800),
    ("link.baud", 4_000_001, "link: baud is 4000001: it should be one of 1200, ", 4_000_000),
    ("link.baud", 9600.0, f"link: baud is 9600.0: {WHOLE}"),
    ("link.baud", True, f"link: baud is True: {WHOLE}"),
]
BY_UDP = [
    ("link.port", 0, f"link: port is 0: {LEAST} 1", 1),
    ("link.port", 65536, f"link: port is 65536: {MOST} 65535", 65535),
    ("link.port", "5005", f"link: port is '5005': {WHOLE}"),
    ("link.host", "", "link: host is '': it should have at least 1 character"),
    ("link.baud", 1, "link: has no key 'baud'; known here are host, port, program"),
    ("link.program", "other", "link: program is 'other': it should be 'none' or 'reference'", "reference"),
]
OF_MOTEUS = [
    ("link.watchdog", 0.019, f"link: watchdog is 0.019: {LEAST} 0.02 s", 0.02),
    ("link.watchdog", 1.001, f"link: watchdog is 1.001: {MOST} 1 s", 1.0),
]
TABLES = {
    "a scene": (language.parse, SCENE, IN_A_SCENE),
    "a slider": (language.parse, SLIDER, ON_A_SLIDER),
    "a spring": (language.parse, SPRING, ON_A_SPRING),
    "a device": (description.parse, DEVICE, IN_A_DEVICE),
    "a serial line": (description.parse, ON_SERIAL, ON_A_SERIAL_LINE),
    "UDP": (description.parse, ON_UDP, BY_UDP),
    "moteus": (description.parse, MOTEUS, OF_MOTEUS),
}


def refusal(parse, content):
    """What is said of the content; nothing if it is taken."""
    try:
        parse(content, "FILE")
    except ValueError as refused:
        assert len(getattr(refused, "found", ["one"])) == 1, refused.found
        return str(refused)
    return ""


@pytest.mark.parametrize("name", TABLES)
def test_what_is_wrong_is_refused_with_name_value_limit_and_unit_and_what_is_just_right_is_taken(name):
    """Nothing around it looks wrong because of it."""
    parse, content, rows = TABLES[name]
    assert refusal(parse, content) == ""
    for place, wrong, sentence, *right in rows:
        said = refusal(parse, changed(content, place, wrong))
        assert said.startswith(f"FILE: {sentence}") and "\n" not in said, (place, wrong, said)
        assert [refusal(parse, changed(content, place, value)) for value in right] == [""] * len(right), place


def test_no_sentence_has_words_of_python_or_of_pydantic():
    for parse, content, rows in TABLES.values():
        for place, wrong, *_ in rows:
            said = refusal(parse, changed(content, place, wrong))
            assert not re.search("tuple|dict|valid|instance|integer|string|Input|object", said), said
