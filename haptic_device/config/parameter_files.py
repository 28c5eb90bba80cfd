# SPDX-License-Identifier: Apache-2.0
"""Parameter files of ROS 2: what they give each node, and one sentence for each thing that is wrong in them."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from haptic_device.config import yaml_reader
from haptic_device.config.files import find_beside
from haptic_device.config.parameter_sections import SECTION, given_to, outside, sections
from haptic_device.config.parameter_types import ROS_OWN, Parameter, check_value, shown, unknown

Document = dict[str, Any]
Nodes = Mapping[str, tuple[Parameter, ...]]
Values = dict[str, dict[str, Any]]

PLACES = {"device": "devices", "scene": "scenes"}
"""Parameters that name a file that is read, and the folder of config/ whose names they may take."""


def read_operating_point(path: str | Path, nodes: Nodes, namespace: str = "/haptic") -> Values:
    """Reads a ROS 2 parameter file: values for each node in a namespace, {node: {name: value}}.

    The result has only values that are in the file. Later sections win, as in ROS 2. File names (PLACES) are relative
    to the folder of the file and are returned as absolute paths. Raises ConfigError if the file cannot be read, and
    ValueError with the first thing that is wrong in it.

    Args:
        path: the file.
        nodes: the parameters of each node, such as `haptic_sim.node.parameters.NODES`.
        namespace: of the nodes.

    Examples:
        >>> from haptic_device.config.files import find
        >>> from haptic_device.config.parameter_files import read_operating_point
        >>> from haptic_sim.node.parameters import NODES
        >>> read_operating_point(find("", "demo"), NODES)["haptic_driver"]["coupling.stiffness"]  # [N/m]
        2000.0
    """
    document = yaml_reader.load(path, ros=True)
    values, _ = right_values(document, nodes, namespace)
    for sentence in (*operating_point_problems(document, nodes), *file_problems(values, path)):
        raise ValueError(f"{path}: {sentence}")
    return values


def right_values(document: Document, nodes: Nodes, namespace: str = "/haptic") -> tuple[Values, dict[str, set[str]]]:
    """Of each node the values that are right, {node: {name: value}}, and the names of those that are not."""
    values: Values = {node: {} for node in nodes}
    wrong: dict[str, set[str]] = {node: set() for node in nodes}
    found = sections(document)
    for node, declared in nodes.items():
        given = given_to(f"{namespace.rstrip('/')}/{node}", found)
        for parameter in declared:
            if parameter.name in given:
                try:
                    values[node][parameter.name] = check_value(parameter, given[parameter.name])
                except ValueError:
                    wrong[node].add(parameter.name)
    return values, wrong


def file_problems(values: Values, path: str | Path) -> Iterator[str]:
    """One sentence for each file named in these values that is not there; the others are made absolute in place."""
    for node, given in values.items():
        for name, folder in PLACES.items():
            if name in given:
                try:
                    given[name] = find_beside(path, folder, given[name])
                except (OSError, ValueError) as error:
                    yield f"{node}: {name} {error}"


def operating_point_problems(document: Document, nodes: Nodes) -> Iterator[str]:
    """One sentence for each thing that is wrong in a parameter file, already loaded; nothing when all is well."""
    yield from _strays(document)
    for key, given in sections(document):
        try:
            owners = _owners(key, nodes)
        except ValueError as error:
            yield str(error)
            continue
        for name, value in given.items():
            yield from (f"{key}: {sentence}" for sentence in entry_problems(name, value, owners))


def _strays(document: Document) -> Iterator[str]:
    """Sentences for what stands outside every ros__parameters, where ROS 2 would not look or not start."""
    for path, name, content in outside(document):
        key = f"{path}/{name}" if path else name
        if name == SECTION and not path:
            yield f"{SECTION} stands without a node name above it, such as /**/haptic_driver"
        elif name == SECTION and not isinstance(content, dict):
            yield f"{key} holds no parameters; indent them below it"
        elif not isinstance(content, dict):
            yield f"{key} holds {shown(content)}; a node name with {SECTION} below it belongs there"


def _owners(key: str, nodes: Nodes) -> Nodes:
    """The nodes that a section may reach in some namespace: {node: parameters}."""
    last = key.rsplit("/", 1)[-1]
    if last in ("*", "**"):
        return nodes
    if last not in nodes:
        raise ValueError(unknown(last, "a node of this package", nodes))
    if key == last:
        raise ValueError(f"{key} reaches only a node outside any namespace; write /**/{key} or /haptic/{key}")
    return {last: nodes[last]}


def entry_problems(name: str, value: Any, owners: Nodes) -> Iterator[str]:
    """One sentence for each thing that is wrong with a value for these nodes, {node: parameters}."""
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
