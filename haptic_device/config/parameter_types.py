# SPDX-License-Identifier: Apache-2.0
"""A parameter is a field of a pydantic model, declared in one line; here is what is read from it and what it allows."""

import array
import math
import re
from collections.abc import Iterable
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BaseModel, Field

from haptic_device.config.files import nearest

ROS_OWN = re.compile(r"use_sim_time|start_type_description_service|qos_overrides\..*")
KINDS = {bool: "boolean", int: "integer", float: "decimal number", str: "text", dict: "mapping", list: "list"}
MOST = 1e9


class Parameter(NamedTuple):
    """Declaration of one parameter of a node.

    Attributes:
        name: full name, such as `coupling.stiffness`.
        default: value if none is given; an empty tuple is an empty list of numbers.
        unit: SI unit of the value and its limits, "" for none.
        meaning: what it is, in words.
        low: least value that is allowed; of each element of a list.
        high: largest value that is allowed; of each element of a list.
        live: whether it may change while the node runs; else it is fixed once the node has started.
        choices: the allowed texts, if only some texts are allowed.
        felt: value up to which a hand tells values apart, where a slider ends; a field takes all allowed values.

    Examples:
        >>> from haptic_sim.node.parameters import NODES
        >>> stiffness = next(one for one in NODES["haptic_driver"] if one.name == "coupling.stiffness")
        >>> stiffness.default, stiffness.unit, stiffness.low, stiffness.high, stiffness.live
        (1000.0, 'N/m', 0.0, 100000.0, True)
    """

    name: str
    default: bool | int | float | str | tuple[float, ...] | tuple[str, ...]
    unit: str
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    live: bool = False
    choices: tuple[str, ...] = ()
    felt: float | None = None


class Group(BaseModel, defer_build=True):
    """Parameters that belong together. Their validators are built when one is asked for: all take 30 ms."""


class Watched(NamedTuple):
    """A figure, and the limits beyond which it is WARN and ERROR: above them, or below where error lies below warn."""

    name: str
    unit: str
    meaning: str
    warn: float
    error: float


def fixed(default: Any, unit: str, meaning: str, low: float = -math.inf, high: float = math.inf, **more: Any) -> Any:
    """Field of a parameter that is fixed once the node runs; the rest as in Parameter."""
    told = {"unit": unit, "meaning": meaning, "low": low, "high": high, **more}
    return Field(default, json_schema_extra=told)


def live(
    default: Any, unit: str, meaning: str, low: float = -math.inf, high: float = math.inf, felt: float | None = None
) -> Any:
    """Field of a parameter that may change while the node runs; felt is high where it is not given."""
    felt = high if felt is None and high < math.inf else felt
    return fixed(default, unit, meaning, low, high, live=True, felt=felt)


def parameters_of(model: type[Group], prefix: str = "") -> tuple[Parameter, ...]:
    """The parameters that a model declares, in its order; those of a group are called group.field."""
    found: list[Parameter] = []
    for name, field in model.model_fields.items():
        kind, name = field.annotation, prefix + name
        if isinstance(kind, type) and issubclass(kind, Group):
            found += parameters_of(kind, f"{name}.")
        else:
            choices = get_args(kind) if get_origin(kind) is Literal else ()
            told: Any = field.json_schema_extra
            found.append(Parameter(name, field.default, choices=choices, **told))
    return tuple(found)


def limits_of(watched: Iterable[Watched]) -> tuple[Parameter, ...]:
    """Two live parameters a figure: diagnostics.NAME.warn and diagnostics.NAME.error."""
    return tuple(
        Parameter(f"diagnostics.{each.name}.{level}", limit, each.unit, _limit_meaning(each, level), -MOST, MOST, True)
        for each in watched
        for level, limit in (("warn", each.warn), ("error", each.error))
    )


def defaults(parameters: Iterable[Parameter]) -> dict[str, Any]:
    """The default of each parameter, {name: value}.

    Args:
        parameters: such as those of one node in `haptic_sim.node.parameters.NODES`.

    Examples:
        >>> from haptic_device.config.parameter_types import defaults
        >>> from haptic_sim.node.parameters import NODES
        >>> defaults(NODES["haptic_driver"])["servo.rate"]  # [Hz]
        4000.0
    """
    return {parameter.name: parameter.default for parameter in parameters}


def check_value(parameter: Parameter, value: Any) -> Any:
    """Checks a value and returns it; a list is returned as a tuple.

    Raises ValueError with one sentence if the type, the range or the choice is wrong, or a number is not finite.

    Args:
        parameter: what is declared.
        value: what is given, as YAML has it.

    Examples:
        >>> from haptic_device.config.parameter_types import check_value
        >>> from haptic_sim.node.parameters import NODES
        >>> stiffness = next(one for one in NODES["haptic_driver"] if one.name == "coupling.stiffness")
        >>> check_value(stiffness, 500.0)
        500.0
        >>> check_value(stiffness, -1.0)
        Traceback (most recent call last):
            ...
        ValueError: coupling.stiffness is -1.0 N/m; at least 0.0 N/m is needed
    """
    if not isinstance(parameter.default, tuple):
        return _check_scalar(parameter, parameter.name, type(parameter.default), value)
    if not isinstance(value, list | tuple | array.array):
        raise ValueError(f"{parameter.name} is {shown(value)}; write a list: [{shown(value)}]")
    kind = type(parameter.default[0]) if parameter.default else float
    return tuple(_check_scalar(parameter, f"{parameter.name}[{i}]", kind, item) for i, item in enumerate(value))


def unknown(name: str, owner: str, known: Iterable[str]) -> str:
    """The sentence that refuses a name which is not among the known ones, with the nearest of them."""
    near = nearest(name, known)
    return f"{name} is not {owner}" + (f"; did you mean {near}?" if near else "")


def shown(value: Any) -> str:
    """A value as a parameter file has it."""
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)


def _limit_meaning(each: Watched, level: str) -> str:
    return f"{level.upper()} {'above' if each.error >= each.warn else 'below'} this: {each.meaning}"


def _check_scalar(parameter: Parameter, name: str, kind: type, value: Any) -> Any:
    if type(value) is not kind:
        written = KINDS.get(type(value), type(value).__name__)
        raise ValueError(f"{name} is {shown(value)} ({written}); {_remedy(parameter, kind, value)}")
    if isinstance(value, int | float) and kind is not bool:
        _check_number(parameter, name, value)
    if kind is str and parameter.choices and value not in parameter.choices:
        raise ValueError(f"{name} is {value!r}; it must be one of {', '.join(parameter.choices)}")
    return value


def _check_number(parameter: Parameter, name: str, value: float) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}; a finite number{_in(parameter)} is needed")
    given = f"{name} is {_amount(parameter, value)}"
    if value < parameter.low:
        raise ValueError(f"{given}; at least {_amount(parameter, parameter.low)} is needed")
    if value > parameter.high:
        raise ValueError(f"{given}; at most {_amount(parameter, parameter.high)} is allowed")


def _remedy(parameter: Parameter, kind: type, value: Any) -> str:
    """What to write instead of a value of the wrong type."""
    if kind is float and type(value) is int:
        return f"write {_amount(parameter, float(value))}"
    if kind is int and type(value) is float and value.is_integer():
        return f"write {_amount(parameter, int(value))}"
    if kind is str and type(value) is bool:
        return "ROS takes an unquoted y, yes, on, n, no or off for a boolean: put the text in quotes"
    if kind is str and type(value) in (int, float):
        return f'put it in quotes: "{value}"'
    wanted = {bool: "true or false", int: "a whole number", float: "a number with a decimal point", str: "text"}
    return f"{wanted[kind]}{_in(parameter)} is needed"


def _amount(parameter: Parameter, value: float) -> str:
    return f"{shown(value)} {parameter.unit}".rstrip()


def _in(parameter: Parameter) -> str:
    return f" in {parameter.unit}" if parameter.unit else ""
