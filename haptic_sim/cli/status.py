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
from haptic_device.status import LEVELS
from haptic_sim.cli.keys import ESTOP, keys
from haptic_sim.live.processes import NAMESPACE

STYLES = ("green", "yellow", "bold red", "magenta")
STALE = 2.0  # [s] without news after which a status counts no more
LISTENING = 2.0  # [s] that one look without a terminal takes
KEYS = {ESTOP: "estop", "r": "reset", "e": "enable", "d": "disable"}
HELP = "space: e-stop   r: reset   e: enable   d: disable   q: quit"
NODES = ("haptic_driver", "haptic_loopback", "haptic_simulation", "haptic_recorder")


def status(
    domain: Annotated[int | None, typer.Option(min=0, max=232, help="ROS domain [ROS_DOMAIN_ID, or 0].")] = None,
    namespace: Annotated[str, typer.Option(help="Namespace of the system.")] = NAMESPACE,
    json: Annotated[bool, typer.Option("--json", help="Listen for 2 s, print one JSON object, end.")] = False,
) -> None:
    """Show all nodes and figures with their levels, live; space is the e-stop. Exit code 1 for ERROR or silence."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    from haptic_sim.client import Client

    domain = ros_environment.domain() if domain is None else domain
    with contextlib.closing(Client.join("haptic_status", domain, namespace)) as client:
        if json or not (sys.stdin.isatty() and sys.stdout.isatty()):
            found = _listen(client)
            print(json_text.dumps(found)) if json else _print(found, domain)
        else:
            found = _watch(client, domain)
    if not found and (why := ros_environment.discovery()):
        print(f"haptic status: nothing was heard; {why}", file=sys.stderr)
    raise typer.Exit(0 if found and max(entry["level"] for entry in found.values()) < LEVELS.index("ERROR") else 1)


def newest(client) -> dict:
    """{name: {level, message, values}} of every status; a node that was heard of and is silent now is STALE."""
    now = time.monotonic()
    found = {}
    for name, said in sorted(client.statuses.items(), key=_order):
        stale = now - client.heard[name] > STALE
        level = LEVELS.index("STALE") if stale else said.level
        message = f"nothing heard for {now - client.heard[name]:.0f} s" if stale else said.message
        found[name] = {"level": level, "message": message, "values": said.values}
    return found


def _order(item):
    node = item[0].split(":")[0]
    return NODES.index(node) if node in NODES else len(NODES), node, ":" in item[0]


def _listen(client) -> dict:
    end = time.monotonic() + LISTENING
    while time.monotonic() < end:
        client.look()
        time.sleep(0.02)
    return newest(client)


def _watch(client, domain) -> dict:
    """Until q or Ctrl-C; a key's answer is shown below the table."""
    from rich.console import Group
    from rich.live import Live
    from rich.text import Text

    from haptic_sim.questions import trigger

    answer, questions = "", {key: trigger(f"haptic_driver/{service}") for key, service in KEYS.items()}
    client.prepare(*(question.service for question in questions.values()))
    with contextlib.suppress(KeyboardInterrupt), keys() as pressed, Live(auto_refresh=False) as display:
        while (key := pressed()) != "q":
            if key in questions:
                answer = _answer(client, questions[key])
            client.look()
            display.update(Group(table(newest(client), domain, client.motor_force), HELP, Text(answer)), refresh=True)
            time.sleep(0.05)
    return newest(client)


def _answer(client, question) -> str:
    name = question.service.rpartition("/")[2]
    try:
        return f"{name}: {client.call(question)}"
    except ValueError as refusal:
        return f"{name} refused: {refusal}"


def _print(found, domain) -> None:
    from rich.console import Console

    Console().print(table(found, domain))


def table(found: dict, domain: int, motor: float | None = None):
    """A row for each node and each of its figures; motor [N]: force on the handle, where the loopback tells it."""
    from rich.table import Table
    from rich.text import Text  # what stands in statuses may look like markup

    title = f"ROS domain {domain}" + ("" if motor is None else f", on the hand {motor:.2f} N")
    rows = Table("node", "figure", "level", "", title=title, caption="" if found else "nothing heard yet")
    for name, entry in found.items():
        node, _, figure = name.partition(": ")
        level = Text(LEVELS[entry["level"]], STYLES[entry["level"]])
        rows.add_row(Text("" if figure else node), Text(figure), level, Text(entry["message"]))
    return rows
