# SPDX-License-Identifier: Apache-2.0
"""`haptic get`, `haptic set`, `haptic save`: parameters of running nodes, live, and as a file to start from again."""

import contextlib
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from haptic_device import ros_environment
from haptic_device.config import yaml_reader
from haptic_device.config.parameter_sections import SECTION
from haptic_device.config.parameter_types import ROS_OWN, unknown
from haptic_display.cli.completion import node_name, parameter
from haptic_display.cli.numbers import whole
from haptic_display.cli.words import next_step, shown_path
from haptic_display.run.processes import NAMESPACE, parameter_text

LISTENING = 1.5  # [s] in which nodes that are there are found
SHOWING = 5.0  # [s] in which a node that is starting is seen
ALL_THE_SAME = 0.5  # [s] for the answer of a node that is seen in another namespace only: the graph may lack ours
PATIENCE = 15.0  # [s] for the answer of a node that is there: it may be starting
OF_A_START = {"autostart", "bag"}  # parameters that whoever starts a node gives
_ANY = parameter(live=False)
Node = Annotated[str, typer.Argument(help="Name of the node, such as haptic_driver.", autocompletion=node_name)]
Domain = Annotated[int | None, whole(0, 232, help="ROS domain [ROS_DOMAIN_ID, or 0].")]
Namespace = Annotated[str, typer.Option(help="Namespace of the system.")]


def set_value(
    node: Node,
    name: Annotated[str, typer.Argument(help="Name of a live parameter.", autocompletion=parameter(live=True))],
    value: Annotated[str, typer.Argument(help="Its value, as in a parameter file; 1500 serves for 1500.0.")],
    domain: Domain = None,
    namespace: Namespace = NAMESPACE,
) -> None:
    """Set a live parameter of a running node, and print what it is now. Exit code 1 with the node's sentence."""
    wanted = read_value(value)
    with _client(domain, namespace) as client:
        from haptic_display.service_requests import get_parameters, set_parameters

        _asked(client, set_parameters(node, {name: wanted}))
        print(parameter_text(_asked(client, get_parameters(node, [name]))[name]))


def get(
    node: Node,
    name: Annotated[str | None, typer.Argument(help="Of one parameter only.", autocompletion=_ANY)] = None,
    domain: Domain = None,
    namespace: Namespace = NAMESPACE,
) -> None:
    """Print the parameters of a running node as a parameter file has them, or one value."""
    with _client(domain, namespace) as client:
        values = _values(client, node)
    if name is None:
        print(_lines(values), end="")
    elif name not in values:
        raise ValueError(unknown(name, f"a parameter of {node}", values))
    else:
        print(parameter_text(values[name]))


def save(
    file: Annotated[Path, typer.Argument(help="New file.")], domain: Domain = None, namespace: Namespace = NAMESPACE
) -> None:
    """Write the operating point of a running display as a parameter file, which haptic demo --params starts again."""
    if file.exists():
        raise ValueError(f"{file} exists already; name a new file")
    with _client(domain, namespace) as client:
        found = {node: _values(client, node) for node in _nodes(client)}
        if not found:
            why = ros_environment.discovery() or "does it run in this domain?"
            raise ValueError(f"no node of a display is found in {namespace}; {why}")
    _write(file, _document(found))
    print(f"{file} holds the parameters of {', '.join(found)}")
    next_step(f"haptic demo --params {shown_path(file)}")


def read_value(text: str) -> Any:
    """What a parameter file means by this text. Raises ValueError, one sentence, if it is no value of a parameter."""
    try:
        found = yaml_reader.loads(f"value: {text}", ros=True)
    except ValueError:
        found = {}
    if found.keys() != {"value"} or isinstance(found["value"], dict):
        raise ValueError(f"{text!r} is no value of one parameter; write a number, true, false, a text, or [a, list]")
    return found["value"]


@contextlib.contextmanager
def _client(domain: int | None, namespace: str) -> Iterator:
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    domain = ros_environment.domain() if domain is None else domain
    from haptic_display.client import Client

    with contextlib.closing(Client.join("haptic_parameters", domain, namespace)) as client:
        yield client


def _asked(client, question) -> Any:
    """What the answer means. A node that nobody sees is said sooner than one that does not answer, one that is seen in
    another namespace only still sooner."""
    began, node, service = time.monotonic(), question.service.rpartition("/")[0], client.service(question.service)
    while not service.ready and time.monotonic() - began < (LISTENING if client.namesakes(node) else SHOWING):
        client.look()
        time.sleep(0.02)
    patience = {"patience": PATIENCE} if service.ready else {"patience": ALL_THE_SAME} if client.namesakes(node) else {}
    return client.call(question, **patience)


def _values(client, node: str) -> dict[str, Any]:
    """{name: value} of a node's parameters in the order of their declaration, without those of ROS."""
    from haptic_display.service_requests import get_parameters, list_parameters

    names = [name for name in _asked(client, list_parameters(node)) if not ROS_OWN.fullmatch(name)]
    return _asked(client, get_parameters(node, names))


def _nodes(client) -> list[str]:
    """Our nodes that are in the client's namespace."""
    from haptic_sim.node.parameters import NODES

    own, end = client.node.get_namespace(), time.monotonic() + LISTENING
    while time.monotonic() < end:
        client.look()
        time.sleep(0.02)
    there = {name for name, namespace in client.node.get_node_names_and_namespaces() if namespace == own}
    return [name for name in NODES if name in there]


def _document(found: dict[str, dict[str, Any]]) -> str:
    sections = []
    for node, values in found.items():
        kept = {name: value for name, value in values.items() if name not in OF_A_START}
        sections.append(f"/**/{node}:\n  {SECTION}:\n{_lines(kept, '    ')}")
    return "".join(sections)


def _write(file: Path, text: str) -> None:
    """The file whole, or not at all. Raises ValueError where `haptic check` would find something wrong."""
    from haptic_display.run.config_problems import problems

    with tempfile.TemporaryDirectory(dir=file.absolute().parent) as folder:
        fresh = Path(folder) / file.name
        fresh.write_text(text, encoding="utf-8")
        if wrong := problems(fresh):
            raise ValueError(f"{file} is not written, it would not start again: {wrong[0]}")
        os.link(fresh, file)  # which refuses to overwrite


def _lines(values: dict[str, Any], indent: str = "") -> str:
    return "".join(f"{indent}{name}: {parameter_text(value)}\n" for name, value in values.items())
