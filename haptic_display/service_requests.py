# SPDX-License-Identifier: Apache-2.0
"""What can be asked of a running node's services, and what the answers mean; client.py asks."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import SetBool, Trigger

KINDS = {  # of services that are no Trigger
    "pause": SetBool,
    "set_parameters": SetParameters,
    "get_parameters": GetParameters,
    "list_parameters": ListParameters,
    "set_parameters_atomically": SetParametersAtomically,
    "get_state": GetState,
    "change_state": ChangeState,
}


class RefusedError(ValueError):
    """A node answered that it will not; its own sentence."""


class Question(NamedTuple):
    """A request to a service, named as "node/service", and what an answer means: read(answer), which may refuse."""

    service: str
    request: Any
    read: Callable[[Any], Any] = lambda answer: answer


def trigger(service: str) -> Question:
    """A std_srvs/Trigger such as "haptic_driver/enable"; gives its message."""

    def read(answer):
        if not answer.success:
            raise RefusedError(answer.message or f"{service} refused")
        return answer.message

    return Question(service, Trigger.Request(), read)


def list_parameters(node: str) -> Question:
    """Gives the names of a node's parameters, in the order of their declaration."""
    return Question(f"{node}/list_parameters", ListParameters.Request(), lambda answer: list(answer.result.names))


def get_parameters(node: str, names: Iterable[str]) -> Question:
    """Gives {name: value} of a node's parameters, arrays as tuples, without those that it does not have."""
    names = list(names)

    def read(answer):
        values = (_plain(parameter_value_to_python(value)) for value in answer.values)
        return {name: value for name, value in zip(names, values, strict=False) if value is not None}

    return Question(f"{node}/get_parameters", GetParameters.Request(names=names), read)


def set_parameters(node: str, values: dict) -> Question:
    """Sets {name: value} of a node, all or none; lists and tuples are arrays of doubles, or of texts."""

    def read(answer):
        if not answer.result.successful:
            raise RefusedError(answer.result.reason or f"{node} refused {', '.join(values)}")

    request = SetParametersAtomically.Request(parameters=[_parameter(*item) for item in values.items()])
    return Question(f"{node}/set_parameters_atomically", request, read)


def state_of(node: str) -> Question:
    """Gives the number of the state that a managed node is in (lifecycle_msgs/State)."""
    return Question(f"{node}/get_state", GetState.Request(), lambda answer: answer.current_state.id)


def change_state(node: str, transition: int) -> Question:
    """A transition of a managed node (lifecycle_msgs/Transition)."""
    request = ChangeState.Request()
    request.transition.id = transition

    def read(answer):
        if not answer.success:
            raise RefusedError(f"{node} refused; its log says why")

    return Question(f"{node}/change_state", request, read)


def kind_of(service: str) -> type:
    """The ROS type of a service by its name."""
    return KINDS.get(service.rpartition("/")[2], Trigger)


def _plain(value):
    return tuple(value) if not isinstance(value, bool | int | float | str) and value is not None else value


def _parameter(name: str, value):
    if not isinstance(value, list | tuple):
        return Parameter(name, value=value).to_parameter_msg()
    if any(not isinstance(item, int | float) or isinstance(item, bool) for item in value):
        return Parameter(name, Parameter.Type.STRING_ARRAY, [str(item) for item in value]).to_parameter_msg()
    return Parameter(name, Parameter.Type.DOUBLE_ARRAY, [float(item) for item in value]).to_parameter_msg()
