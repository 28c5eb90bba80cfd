# SPDX-License-Identifier: Apache-2.0
"""`haptic status`: how a running system is, live in the terminal, with the keys that stop it."""

import contextlib
import json as json_text
import os
import sys
import time
from typing import Annotated

import typer

from haptic_device import ros_environment
from haptic_device.digits import amount
from haptic_device.process import say
from haptic_device.recording.status import LEVELS
from haptic_display.cli import words
from haptic_display.cli.keys import ESTOP, keys
from haptic_display.cli.numbers import whole
from haptic_display.run.processes import NAMESPACE

STYLES = ("green", "yellow", "bold red", "magenta")
STALE = 2.0  # [s] without news after which a status counts no more
LISTENING = 2.0  # [s] that one look without a terminal takes
SILENCE = 5.0  # [s] of it before nodes are taken to be none: they announce themselves every 3 s
KEYS = {ESTOP: "estop", "r": "reset", "e": "enable", "d": "disable"}
HELP = "space: e-stop   r: reset   e: enable   d: disable   q: quit"
NODES = ("haptic_driver", "haptic_bridge", "haptic_loopback", "haptic_simulation", "haptic_recorder")


def status(
    domain: Annotated[int | None, whole(0, 232, help="ROS domain [ROS_DOMAIN_ID, or 0].")] = None,
    namespace: Annotated[str | None, typer.Option(help="Namespace of one display; else every one is shown.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Listen for 2 to 5 s, print one JSON object, end.")] = False,
) -> None:
    """Show all nodes and figures with their levels, live; space is the e-stop. Exit code 1 for ERROR or silence."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    from haptic_display.client import Client

    domain = ros_environment.domain() if domain is None else domain
    with contextlib.closing(Client.join("haptic_status", domain, namespace or NAMESPACE)) as client:
        if json or not (sys.stdin.isatty() and sys.stdout.isatty()):
            found = _listen(client, namespace is None)
            print(json_text.dumps(found)) if json else words.console().print(table(found, domain))
        else:
            found = _watch(client, domain, namespace is None)
    if not found and (why := ros_environment.discovery()):
        say(f"haptic status: nothing was heard; {why}")
    if not found and not json:
        words.next_step("haptic demo --view starts a display; --domain N looks into another ROS domain")
    raise typer.Exit(0 if found and max(entry["level"] for entry in found.values()) < LEVELS.index("ERROR") else 1)


def newest(client, everywhere: bool = False) -> dict:
    """{name: {level, message, values}} of every status; a node that was heard of and is silent now is STALE.

    everywhere: of the displays in other namespaces too; where there are several, each name begins with its namespace.
    """
    said = {name: (one, client.heard[name]) for name, one in client.statuses.items()}
    displays = {client.node.get_namespace(): said, **(client.elsewhere if everywhere else {})}
    several = sum(any("namespace" in one.values for one, _ in said.values()) for said in displays.values()) > 1
    return {
        f"{where.rstrip('/')}/{name}" if several else name: _status(one, time.monotonic() - when)
        for where, said in sorted(displays.items())
        for name, (one, when) in sorted(said.items(), key=_order)
    } or _unheard(client.node)


def _unheard(node) -> dict:
    """One entry, named as the namespace, which names our nodes that run all the same: elsewhere, or not active."""
    found = sorted(f"{at.rstrip('/')}/{name}" for name, at in node.get_node_names_and_namespaces() if name in NODES)
    said = {"level": LEVELS.index("STALE"), "message": f"nothing is heard; there is {', '.join(found)}", "values": {}}
    return {node.get_namespace(): said} if found else {}


def _status(said, age) -> dict:
    if age > STALE:
        return {"level": LEVELS.index("STALE"), "message": f"nothing heard for {age:.0f} s", "values": said.values}
    return {"level": said.level, "message": _message(said), "values": said.values}


def _message(said) -> str:
    """A node's own words; of a latched fault what it is, and what to do."""
    if not (name := said.values.get("fault")):
        return said.message
    from haptic_display.fault_sentence import FAULTS, TYPE, what_to_do  # it loads numpy

    number, first = (said.values.get(f"fault_{entry}", "") for entry in ("detail", "first"))
    return what_to_do(name, number, TYPE, first) if name in FAULTS else said.message


def _order(item):
    node = item[0].split(":")[0]
    return NODES.index(node) if node in NODES else len(NODES), node, ":" in item[0]


def _listen(client, everywhere) -> dict:
    began = time.monotonic()
    while time.monotonic() - began < (LISTENING if client.heard or everywhere and client.elsewhere else SILENCE):
        client.look()
        time.sleep(0.02)
    return newest(client, everywhere)


def _watch(client, domain, everywhere) -> dict:
    """Until q or Ctrl-C; a key's answer is shown below the table."""
    from rich.console import Group
    from rich.live import Live
    from rich.text import Text

    answer = ""
    with contextlib.suppress(KeyboardInterrupt), keys() as pressed, Live(auto_refresh=False) as display:
        while (key := pressed()) != "q":
            drivers = _drivers(client, everywhere)
            client.prepare(*(f"{driver}/{service}" for driver in drivers for service in KEYS.values()))
            if key in KEYS:
                answer = _answers(client, drivers, KEYS[key])
            client.look()
            motor = client.motor_force if client.truth else None
            shown = table(newest(client, everywhere), domain, motor)
            display.update(Group(shown, HELP, Text(answer)), refresh=True)
            time.sleep(0.05)
    return newest(client, everywhere)


def _drivers(client, everywhere) -> list[str]:
    """Full names of the drivers that are heard; that of the client's namespace while there is none."""
    own = client.node.get_namespace().rstrip("/")
    heard = [own] if "haptic_driver" in client.statuses else []
    if everywhere:
        heard += [where.rstrip("/") for where, said in client.elsewhere.items() if "haptic_driver" in said]
    return [f"{where}/haptic_driver" for where in heard or [own]]


def _answers(client, drivers, service) -> str:
    """What the drivers answer; of several, all get an e-stop, and nothing else, which is meant for one."""
    from haptic_display.service_requests import trigger

    if len(drivers) > 1 and service != KEYS[ESTOP]:
        return f"{service} refused: {len(drivers)} displays are here; name one by --namespace"
    services = [f"{driver}/{service}" for driver in drivers]
    for each in services[1:]:  # none of them waits for the answer of another
        with client.ask(trigger(each)) as asking:
            asking.poll()
    return "; ".join(_answer(client, each) for each in services)


def _answer(client, service) -> str:
    from haptic_display.service_requests import trigger

    name = service.rpartition("/")[2]
    try:
        return f"{name}: {client.call(trigger(service))}"
    except ValueError as refusal:
        return f"{name} refused: {refusal}"


def table(found: dict, domain: int, motor: float | None = None):
    """A row for each node and each of its figures; motor [N]: force on the handle, where the loopback tells it."""
    title = f"ROS domain {domain}" + ("" if motor is None else f", on the hand {amount(motor, 'N')}")
    caption = "" if found else "nothing heard yet"
    heads = "node", "figure", "level", "now"
    return words.table(heads, map(_row, found, found.values()), title=title, caption=caption)


def _row(name: str, entry: dict):
    node, _, figure = name.partition(": ")
    level, message = (LEVELS[entry["level"]], STYLES[entry["level"]]), entry["message"]
    return ("", figure.replace("_", " "), level, _rounded(message)) if figure else (node, "", level, message)


def _rounded(message: str) -> str:
    """The value and unit that the message of a figure is, to three digits; any other message as it is."""
    value, _, unit = message.partition(" ")
    try:
        return amount(float(value), unit)
    except ValueError:
        return message
