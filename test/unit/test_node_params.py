# SPDX-License-Identifier: Apache-2.0
"""Declarations as parameters of a live ROS 2 node: start values, refusals, live changes."""

import math
from types import SimpleNamespace

import pytest
import rclpy
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from haptic_device.config import yaml_reader
from haptic_device.config.parameter_types import Parameter, defaults
from haptic_device.nodes.ros import KINDS, refuse_files_of_others
from haptic_device.nodes.ros_parameters import declare, on_change
from haptic_sim.node.parameters import NODES

STIFFNESS = Parameter("wall.stiffness", 1000.0, "N/m", "stiffness of the wall", low=0.0, high=5000.0, live=True)
RATE = Parameter("rate", 4000, "Hz", "servo rate", low=1000, high=10000)
NORMAL = Parameter("wall.normal", (), "", "normal of the wall", low=-1.0, high=1.0)
OFFSETS = Parameter("wall.offsets", (), "m", "distances of the walls", live=True)
AXES = Parameter("axes", ("x", "y"), "", "axes of the handle")
REALTIME = Parameter("realtime", "prefer", "", "scheduling", choices=("require", "prefer", "off"))
PARAMETERS = (STIFFNESS, RATE, NORMAL, OFFSETS, AXES, REALTIME)


@pytest.fixture
def make_node(tmp_path):
    """make_node(yaml text, *command line) gives a node /haptic/haptic_driver in a context of its own."""
    made = []

    def make(text="", *arguments):
        path = tmp_path / "parameters.yaml"
        path.write_text(text)
        file = ["--params-file", str(path)] if text else []
        context = rclpy.Context()
        rclpy.init(args=["--ros-args", *file, *arguments], context=context)
        node = Node("haptic_driver", namespace="haptic", context=context)
        made.append((node, context))
        return node

    make.path = tmp_path / "parameters.yaml"
    yield make
    for node, context in made:
        node.destroy_node()
        context.shutdown()


def change(node, name, value):
    [result] = node.set_parameters([RosParameter(name, value=value)])
    return result


def test_without_a_file_every_parameter_has_its_default(make_node):
    assert declare(make_node(), PARAMETERS) == defaults(PARAMETERS)


def test_a_file_and_the_command_line_give_the_start_values(make_node):
    text = "/**/haptic_driver: {ros__parameters: {wall: {stiffness: 3e2, normal: [0.0, 1.0]}, axes: []}}"
    node = make_node(text, "-p", "rate:=2000", "-p", "use_sim_time:=false")
    values = declare(node, PARAMETERS)
    assert values["wall.stiffness"] == node.get_parameter("wall.stiffness").value == 300.0
    assert values["wall.normal"] == (0.0, 1.0)
    assert values["axes"] == tuple(node.get_parameter("axes").value) == ()
    assert values["rate"] == 2000


def test_simulated_time_is_refused_at_the_start_and_later(make_node):
    with pytest.raises(ValueError, match="^use_sim_time is true; it must be false"):
        declare(make_node("", "-p", "use_sim_time:=true"), PARAMETERS)
    node = make_node()
    declare(node, PARAMETERS)
    result = change(node, "use_sim_time", True)
    assert not result.successful and "it must be false" in result.reason
    assert node.get_parameter("use_sim_time").value is False


def test_a_descriptor_says_unit_range_and_whether_the_parameter_is_live(make_node):
    node = make_node()
    declare(node, PARAMETERS)
    stiffness, rate = node.describe_parameters(["wall.stiffness", "rate"])
    assert stiffness.description == "stiffness of the wall [N/m]"
    assert (stiffness.floating_point_range[0].from_value, stiffness.floating_point_range[0].to_value) == (0.0, 5000.0)
    assert (rate.integer_range[0].from_value, rate.integer_range[0].to_value) == (1000, 10000)
    assert (stiffness.read_only, rate.read_only) == (False, True)
    normal, realtime = node.describe_parameters(["wall.normal", "realtime"])
    assert normal.additional_constraints == "each from -1.0 to 1.0"
    assert realtime.additional_constraints == "one of require, prefer, off"


def test_an_empty_array_is_an_array_of_numbers_fixed_or_live(make_node):
    node = make_node()
    declare(node, PARAMETERS)
    assert [d.type for d in node.describe_parameters(["wall.normal", "wall.offsets"])] == [8, 8]
    assert list(node.get_parameter("wall.normal").value) == []
    assert not change(node, "wall.normal", [1.0]).successful
    assert change(node, "wall.offsets", [0.1, 0.2]).successful
    assert list(node.get_parameter("wall.offsets").value) == [0.1, 0.2]


def test_a_bad_start_value_is_refused_in_one_sentence(make_node):
    for argument, sentence in (
        ("wall.stiffness:=300", "wall.stiffness is 300 (integer); write 300.0 N/m"),
        ("wall.stiffness:=5000.1", "wall.stiffness is 5000.1 N/m; at most 5000.0 N/m is allowed"),
        ("wall.stifness:=300.0", "wall.stifness is not a parameter of haptic_driver; did you mean wall.stiffness?"),
        ("realtime:=off", "realtime is false (boolean); ROS takes an unquoted y"),
    ):
        with pytest.raises(ValueError) as caught:
            declare(make_node("", "-p", argument), PARAMETERS)
        assert str(caught.value).startswith(sentence)
    with pytest.raises(ValueError, match="scene is not a parameter of haptic_driver"):
        declare(make_node("/**: {ros__parameters: {scene: wall}}"), PARAMETERS)


def test_a_file_is_for_a_node_that_it_has_a_section_for_and_for_all_if_it_has_none_of_its_kind(make_node):
    others = ["/**/haptic_loopback", "/**/haptic_simulation"]
    for keys in (["/**/haptic_driver"], ["/*/haptic_driver"], ["/right/haptic_driver", "/**"], others):
        refuse_files_of_others(make_node(sections(keys)), "haptic_driver", given(make_node))
    assert set(KINDS) == set(NODES)


def test_a_file_that_is_for_a_driver_and_misses_it_is_refused_with_the_names_that_it_has(make_node):
    for keys in (
        ["/**/haptic_driver", "/**/haptic_loopback"],
        ["/right/haptic_driver"],
        ["/**/other_driver"],
        ["haptic_driver"],
    ):
        node = make_node(sections(keys), "-r", "__node:=left_driver")
        with pytest.raises(ValueError) as refused:
            refuse_files_of_others(node, "haptic_driver", given(make_node))
        [_, file] = given(make_node)
        assert str(refused.value) == f"{file} has nothing for /haptic/left_driver, it is for {', '.join(keys)}"


def sections(keys):
    return "".join(f"{key}: {{ros__parameters: {{safety: {{force: 3.0}}}}}}\n" for key in keys)


def given(make_node):
    return ["--params-file", str(make_node.path)]


@pytest.fixture
def taker(make_node):
    """A node that refuses stiff walls; checked and applied are what it was given to check and to apply."""
    node = make_node()
    taker = SimpleNamespace(node=node, start=declare(node, PARAMETERS), checked=[], applied=[])

    def check(values):
        taker.checked.append(values)
        if values["wall.stiffness"] > 2000.0:
            raise ValueError(f"wall.stiffness is {values['wall.stiffness']} N/m; at most 2000.0 N/m is passive")
        return values["wall.stiffness"]

    def apply(values, judged):
        assert judged == values["wall.stiffness"], "what is applied comes with what its own check said"
        taker.applied.append(values)

    on_change(node, PARAMETERS, check, apply)
    return taker


def set_at_once(node, **values):
    changes = [RosParameter(name.replace("__", "."), value=value) for name, value in values.items()]
    return node.set_parameters_atomically(changes)


def test_a_refused_change_leaves_the_value_and_gives_the_sentence(taker):
    assert change(taker.node, "wall.stiffness", 2000.0).successful
    refused = change(taker.node, "wall.stiffness", 2000.5)
    assert not refused.successful
    assert refused.reason == "wall.stiffness is 2000.5 N/m; at most 2000.0 N/m is passive"
    assert taker.node.get_parameter("wall.stiffness").value == 2000.0
    assert [values["wall.stiffness"] for values in taker.applied] == [2000.0]


def test_of_a_request_with_one_refused_parameter_nothing_is_taken(taker):
    for name, value in (("wall__stiffness", 2000.5), ("rate", 2000), ("wall__offsets", ["0"])):
        allowed = {"wall__offsets": [0.1, 0.2]} if name == "wall__stiffness" else {"wall__stiffness": 300.0}
        for request in (allowed | {name: value}, {name: value} | allowed):
            assert not set_at_once(taker.node, **request).successful
    assert taker.applied == []
    assert taker.node.get_parameter("wall.stiffness").value == 1000.0
    assert list(taker.node.get_parameter("wall.offsets").value) == []


def test_a_request_that_another_callback_refuses_is_not_applied(make_node):
    node, checked, applied, open_to = make_node(), [], [], []
    declare(node, PARAMETERS)
    answers = [SetParametersResult(successful=True), SetParametersResult(successful=False, reason="not now")]
    node.add_on_set_parameters_callback(lambda changes: answers[not open_to])  # asked after the later one
    on_change(
        node,
        PARAMETERS,
        lambda values: checked.append(values) or len(checked),
        lambda _, judged: applied.append(judged),
    )
    assert change(node, "wall.stiffness", 300.0).reason == "not now"
    assert (len(checked), applied) == (1, [])
    open_to.append(True)
    assert change(node, "wall.stiffness", 300.0).successful and applied == [2]


def test_what_is_applied_is_what_the_node_says_it_has(taker):
    assert set_at_once(taker.node, wall__stiffness=300.0, wall__offsets=[0.1, 0.2]).successful
    assert set_at_once(taker.node, wall__stiffness=1500.0).successful
    there = {name: taker.node.get_parameter(name).value for name in taker.start}
    said = {name: tuple(value) if isinstance(taker.start[name], tuple) else value for name, value in there.items()}
    assert (len(taker.applied), taker.applied[-1]) == (2, said)
    assert said == {**taker.start, "wall.stiffness": 1500.0, "wall.offsets": (0.1, 0.2)}


def test_a_bad_live_value_never_reaches_the_node(taker):
    for value in (5001, 5000.1, math.nan, math.inf, "stiff"):
        assert not change(taker.node, "wall.stiffness", value).successful
    assert not change(taker.node, "wall.offsets", [math.nan]).successful
    assert taker.checked == taker.applied == []
    assert taker.node.get_parameter("wall.stiffness").value == 1000.0


def test_integers_as_ros_tools_send_them_are_taken_for_doubles_and_an_empty_list_for_its_kind(taker):
    for sent, taken in (([1, 2], (1.0, 2.0)), ([], ())):
        assert set_at_once(taker.node, wall__stiffness=1500, wall__offsets=sent).successful
        assert taker.applied[-1] == {**taker.start, "wall.stiffness": 1500.0, "wall.offsets": taken}
        stiffness, offsets = (taker.node.get_parameter(name) for name in ("wall.stiffness", "wall.offsets"))
        assert (stiffness.type_, offsets.type_) == (RosParameter.Type.DOUBLE, RosParameter.Type.DOUBLE_ARRAY)


@pytest.mark.parametrize("service", [SetParameters, SetParametersAtomically])
def test_a_refused_change_is_answered_with_the_sentence_of_its_parameter(taker, service):
    [serving] = [one for one in taker.node.services if one.srv_type is service]
    for name, value, sentence in (
        ("wall.stifness", 300.0, "wall.stifness is not a parameter of haptic_driver; did you mean wall.stiffness?"),
        ("", 300.0, "'' is not a parameter of haptic_driver"),
        ("wall.stiffness", 5001, "wall.stiffness is 5001.0 N/m; at most 5000.0 N/m is allowed"),
        ("wall.offsets", 1.0, "wall.offsets is 1.0; write a list: [1.0]"),
        ("rate", 2000, "Trying to set a read-only parameter: rate."),
    ):
        changes = [RosParameter("wall.stiffness", value=300.0), RosParameter(name, value=value)]
        request = service.Request(parameters=[change.to_parameter_msg() for change in changes])
        answer = serving.callback(request, service.Response())
        results = answer.results if service is SetParameters else [answer.result]
        assert [result.successful for result in results] == [True, False][-len(results) :]
        assert results[-1].reason == sentence


SCALARS = """
1e3 1. .5 -3 +3 010 08 0x1F -0x1f 1_000 1:30 0 -0 +010 1E-3 1e400 99999999999999999999 0b1 0o7 1.5.2
y N Off on true True tRue ~ null .inf -.INF .nan nan inf infinity 2020-01-01 '3' "y" word =
"""


def test_scalars_mean_to_us_what_they_mean_to_ros(make_node):
    """Our reading of a file against rcl's own parser, value by value."""
    text = "/**:\n  ros__parameters:\n" + "".join(f"    p{i}: {scalar}\n" for i, scalar in enumerate(SCALARS.split()))
    ours = yaml_reader.loads(text, ros=True)["/**"]["ros__parameters"]
    theirs = {name: value.value for name, value in make_node(text)._parameter_overrides.items()}
    for i, scalar in enumerate(SCALARS.split()):
        mine, yours = ours[f"p{i}"], theirs[f"p{i}"]
        assert type(mine) is type(yours), scalar
        assert mine == yours or (math.isnan(mine) and math.isnan(yours)), scalar
