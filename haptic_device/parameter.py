# SPDX-License-Identifier: Apache-2.0
"""A parameter is declared once, beside what uses it; descriptors, documents and file checks are read from that line."""

import array
import difflib
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from haptic_device import ros_yaml

SECTION = "ros__parameters"
ROS_OWN = re.compile(r"use_sim_time|start_type_description_service|qos_overrides\..*")
KINDS = {bool: "boolean", int: "integer", float: "decimal number", str: "text", dict: "mapping", list: "list"}


class Parameter(NamedTuple):
    """One declared parameter. The type is that of the default; the default () declares an empty array of numbers.

    low and high are inclusive and in unit; for arrays they hold for each element. A parameter that is not live is fixed
    once the node has started. choices, where given, are the only texts allowed.
    """

    name: str
    default: bool | int | float | str | tuple[float, ...] | tuple[str, ...]
    unit: str
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    live: bool = False
    choices: tuple[str, ...] = ()


def check_value(parameter: Parameter, value):
    """The value, arrays as tuple, if type, finiteness, range and choice are right; else ValueError, one sentence."""
    if not isinstance(parameter.default, tuple):
        return _check_scalar(parameter, parameter.name, type(parameter.default), value)
    if not isinstance(value, list | tuple | array.array):
        raise ValueError(f"{parameter.name} is {_show(value)}; write a list: [{_show(value)}]")
    kind = type(parameter.default[0]) if parameter.default else float
    return tuple(_check_scalar(parameter, f"{parameter.name}[{i}]", kind, item) for i, item in enumerate(value))


def unknown(name: str, owner: str, known: Iterable[str]) -> str:
    """The sentence that refuses a name which is not among the known ones, with the nearest of them."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"{name} is not {owner}" + (f"; did you mean {near[0]}?" if near else "")


def read_operating_point(path, nodes: Mapping[str, tuple[Parameter, ...]], namespace: str = "/haptic"):
    """What the ROS 2 parameter file at path gives each of the nodes when they run in namespace.

    Returns {node: {name: value}} with the values written in the file only; later sections win, as in ROS 2. Raises
    ValueError with the first sentence of operating_point_problems, and OSError if the file cannot be read.
    """
    document = _load(path)
    for sentence in operating_point_problems(document, nodes):
        raise ValueError(f"{path}: {sentence}")
    values = {node: {} for node in nodes}
    for key, given in _sections(document):
        for node in nodes:
            if _pattern(key).fullmatch(f"{namespace.rstrip('/')}/{node}"):
                declared = {parameter.name: parameter for parameter in nodes[node]}
                taken = {name: check_value(declared[name], given[name]) for name in given if name in declared}
                values[node].update(taken)
    return values


def operating_point_problems(document: dict, nodes: Mapping[str, tuple[Parameter, ...]]) -> Iterator[str]:
    """One sentence for each thing that is wrong in a parameter file, already loaded; nothing when all is well."""
    yield from _strays(document)
    for key, given in _sections(document):
        try:
            owners = _owners(key, nodes)
        except ValueError as error:
            yield str(error)
            continue
        for name, value in given.items():
            yield from (f"{key}: {sentence}" for sentence in _entry_problems(name, value, owners))


def _load(path):
    try:
        return ros_yaml.load(Path(path))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _check_scalar(parameter, name, kind, value):
    if type(value) is not kind:
        written = KINDS.get(type(value), type(value).__name__)
        raise ValueError(f"{name} is {_show(value)} ({written}); {_remedy(parameter, kind, value)}")
    if kind in (int, float):
        _check_number(parameter, name, value)
    if kind is str and parameter.choices and value not in parameter.choices:
        raise ValueError(f"{name} is {value!r}; it must be one of {', '.join(parameter.choices)}")
    return value


def _check_number(parameter, name, value):
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}; a finite number{_in(parameter)} is needed")
    given = f"{name} is {_amount(parameter, value)}"
    if value < parameter.low:
        raise ValueError(f"{given}; at least {_amount(parameter, parameter.low)} is needed")
    if value > parameter.high:
        raise ValueError(f"{given}; at most {_amount(parameter, parameter.high)} is allowed")


def _remedy(parameter, kind, value):
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


def _show(value):
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else repr(value)


def _amount(parameter, value):
    return f"{_show(value)} {parameter.unit}".rstrip()


def _in(parameter):
    return f" in {parameter.unit}" if parameter.unit else ""


def _sections(document, path=""):
    """(node key, {dotted name: value}) for each ros__parameters in the file, in the order of the file."""
    for name, content in document.items():
        key = f"{path}/{name}" if path else name
        if name == SECTION and isinstance(content, dict):
            yield path, dict(_flat(content))
        elif isinstance(content, dict):
            yield from _sections(content, key)


def _strays(document, path=""):
    """Sentences for what stands outside every ros__parameters, where ROS 2 would not look or not start."""
    for name, content in document.items():
        key = f"{path}/{name}" if path else name
        if name == SECTION and not path:
            yield f"{SECTION} stands without a node name above it, such as /**/haptic_driver"
        elif name == SECTION and not isinstance(content, dict):
            yield f"{key} holds no parameters; indent them below it"
        elif not isinstance(content, dict):
            yield f"{key} holds {_show(content)}; a node name with {SECTION} below it belongs there"
        elif name != SECTION:
            yield from _strays(content, key)


def _flat(mapping, prefix=""):
    for name, content in mapping.items():
        if isinstance(content, dict):
            yield from _flat(content, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", content


def _pattern(key):
    """Node key with wildcards as a pattern of full node names: * is one level, ** any number of them."""
    levels = {"**": r"(/\w+)*", "*": r"/\w+"}
    return re.compile("".join(levels.get(level, "/" + re.escape(level)) for level in key.strip("/").split("/")))


def _owners(key, nodes):
    """The nodes that a section may reach in some namespace: {node: parameters}."""
    last = key.rsplit("/", 1)[-1]
    if last in ("*", "**"):
        return nodes
    if last not in nodes:
        raise ValueError(unknown(last, "a node of this package", nodes))
    if key == last:
        raise ValueError(f"{key} reaches only a node outside any namespace; write /**/{key} or /haptic/{key}")
    return {last: nodes[last]}


def _entry_problems(name, value, owners):
    if ROS_OWN.fullmatch(name):
        return
    declared = [parameter for parameters in owners.values() for parameter in parameters if parameter.name == name]
    if not declared:
        known = [parameter.name for parameters in owners.values() for parameter in parameters]
        yield unknown(name, f"a parameter of {' or '.join(owners)}", known)
    for parameter in declared:
        try:
            check_value(parameter, value)
        except ValueError as error:
            yield str(error)
            return
