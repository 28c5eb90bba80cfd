# SPDX-License-Identifier: Apache-2.0
"""Parameter declarations as ROS 2 parameters: descriptors, refusal of unknown names, live changes as one record."""

import sys
from collections.abc import Callable, Iterable, Sized
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from haptic_device.config.parameter_types import ROS_OWN, Parameter, check_value, unknown

INT64 = (-(2**63), 2**63 - 1)
SIM_TIME = "use_sim_time is true; it must be false: a haptic display runs by the machine's own clock, not by /clock"
MOST_AT_ONCE = 200  # entries of a request, more than any node has; each takes milliseconds, and others wait for all


def declare(node: Node, parameters: Iterable[Parameter]) -> dict:
    """Declares the parameters and returns their values: the default, or what a file or -p gave, checked.

    Raises ValueError, one sentence, for a bad value, for a given name that is not declared here (a section /** of a
    file reaches every node), and for use_sim_time.
    """
    parameters = tuple(parameters)
    _refuse_sim_time(node)
    _refuse_unknown(node, [parameter.name for parameter in parameters])
    values = {parameter.name: _initial(node, parameter) for parameter in parameters}
    for parameter in parameters:
        _declare(node, parameter, values[parameter.name])
    return values


def on_change(
    node: Node, parameters: Iterable[Parameter], check: Callable[[dict], Any], apply: Callable[[dict, Any], None]
) -> None:
    """Calls check with all values, wished ones merged in, before a live change; after it apply, with these and what
    check gave.

    check changes nothing; its ValueError refuses the request, all of it. apply must take what check let pass. A request
    of more than MOST_AT_ONCE entries is refused before any of them is looked at. Integers are taken for doubles, as
    `ros2 param set` sends 1500 for 1500.0.
    """
    declared = {parameter.name: parameter for parameter in parameters}
    owner, checked = f"a parameter of {node.get_name()}", []

    def why_not(change):
        """The sentence that refuses one change by itself, in place of rclpy's; "" if there is none."""
        if change.name not in declared:
            return "" if ROS_OWN.fullmatch(change.name) else unknown(change.name or "''", owner, declared)
        try:
            check_value(declared[change.name], change.value)
        except ValueError as error:
            return str(error)
        return ""

    def decide(changes):
        wished = {change.name: change.value for change in changes if change.name in declared}
        sentence = next(filter(None, map(why_not, changes)), "")
        try:
            if wished and not sentence:
                merged = _merged(node, declared, wished)
                checked[:] = merged, check(merged)
        except ValueError as error:
            sentence = str(error)
        return SetParametersResult(successful=not sentence, reason=sentence)

    def take(changes):
        if any(change.name in declared for change in changes):
            apply(*checked)

    def typed(changes):
        return [_typed(change, declared.get(change.name)) for change in changes]

    node.add_pre_set_parameters_callback(typed)
    node.add_on_set_parameters_callback(decide)
    node.add_post_set_parameters_callback(take)
    for service in node.services:
        if service.srv_type in (SetParameters, SetParametersAtomically):
            service.callback = _answered(service.callback, lambda change: why_not(*typed([change])))


def _typed(change, parameter):
    """The change with doubles for integers, and an empty list of the declared kind, which a list does not show."""
    default = parameter.default if parameter else None
    if isinstance(default, float) and change.type_ == RosParameter.Type.INTEGER:
        return RosParameter(change.name, RosParameter.Type.DOUBLE, float(change.value))
    if isinstance(default, tuple) and isinstance(change.value, Sized) and len(change.value) == 0:
        return RosParameter(change.name, _array_type(parameter), [])
    if isinstance(default, tuple) and change.type_ == RosParameter.Type.INTEGER_ARRAY:
        return RosParameter(change.name, RosParameter.Type.DOUBLE_ARRAY, [float(item) for item in change.value])
    return change


def _answered(serve, why_not):
    """As serve does, but for requests that are too long, and with the sentences of why_not(change) for its own."""

    def decide(request, response):
        count, each = len(request.parameters), isinstance(response, SetParameters.Response)
        if count > MOST_AT_ONCE:
            reason = f"{count} parameters in one request; at most {MOST_AT_ONCE} are taken"
            refused = SetParametersResult(successful=False, reason=reason)
            return SetParameters.Response(results=[refused] * count) if each else type(response)(result=refused)
        response = serve(request, response)
        reasons = [why_not(RosParameter.from_parameter_msg(change)) for change in request.parameters]
        if not each:
            reasons = [next(filter(None, reasons), "")]
        for result, reason in zip(response.results if each else [response.result], reasons, strict=True):
            result.reason = reason if reason and not result.successful else result.reason
        return response

    return decide


def _refuse_sim_time(node):
    """No node of ours may follow /clock, now or later: the servo cannot be slowed down, halted or set back."""
    if node.get_parameter("use_sim_time").value:
        raise ValueError(SIM_TIME)

    def decide(changes):
        wanted = any(change.name == "use_sim_time" and change.value for change in changes)
        return SetParametersResult(successful=not wanted, reason=SIM_TIME if wanted else "")

    node.add_on_set_parameters_callback(decide)


def _refuse_unknown(node, declared):
    for name in node._parameter_overrides:
        if name not in declared and not ROS_OWN.fullmatch(name):
            raise ValueError(unknown(name, f"a parameter of {node.get_name()}", declared))


def _initial(node, parameter):
    override = node._parameter_overrides.get(parameter.name)
    if override is None:
        return parameter.default
    # An empty list in a file has no element type; rclpy hands it over as "not set".
    return check_value(parameter, [] if override.value is None else override.value)


def _declare(node, parameter, value):
    descriptor = _descriptor(parameter)
    if value == ():
        _declare_empty(node, parameter, descriptor)
        return
    value = list(value) if isinstance(value, tuple) else value
    node.declare_parameter(parameter.name, value, descriptor, ignore_override=True)


def _declare_empty(node, parameter, descriptor):
    """rclpy takes an empty list for bytes: first the type is declared, then the value set, and then made read-only."""
    kind = _array_type(parameter)
    node.declare_parameter(parameter.name, kind, ParameterDescriptor(), ignore_override=True)
    node.set_parameters([RosParameter(parameter.name, kind, [])])
    descriptor.type = kind.value
    node.set_descriptor(parameter.name, descriptor)


def _array_type(parameter):
    text = bool(parameter.default) and isinstance(parameter.default[0], str)
    return RosParameter.Type.STRING_ARRAY if text else RosParameter.Type.DOUBLE_ARRAY


def _descriptor(parameter):
    descriptor = ParameterDescriptor(description=_description(parameter), read_only=not parameter.live)
    descriptor.additional_constraints = _constraints(parameter)
    if isinstance(parameter.default, float):
        bounds = FloatingPointRange(from_value=parameter.low, to_value=parameter.high)
        descriptor.floating_point_range = [bounds]
    elif isinstance(parameter.default, int) and not isinstance(parameter.default, bool):
        low, high = max(parameter.low, INT64[0]), min(parameter.high, INT64[1])
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return descriptor


def _description(parameter):
    return f"{parameter.meaning} [{parameter.unit}]" if parameter.unit else parameter.meaning


def _constraints(parameter):
    if parameter.choices:
        return f"one of {', '.join(parameter.choices)}"
    numbers = isinstance(parameter.default, tuple) and not any(isinstance(item, str) for item in parameter.default)
    limited = max(abs(parameter.low), abs(parameter.high)) < sys.float_info.max
    return f"each from {parameter.low} to {parameter.high}" if numbers and limited else ""


def _merged(node, declared, wished):
    """All values in force, as declare returned them, with the wished ones instead."""
    now = {name: wished[name] if name in wished else node.get_parameter(name).value for name in declared}
    return {name: check_value(parameter, now[name]) for name, parameter in declared.items()}
