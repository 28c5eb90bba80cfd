# SPDX-License-Identifier: Apache-2.0
"""What is wrong with the display, and what to do and press: nodes that ended or are silent, a latched fault."""

import time
from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

from haptic_device.control.faults import FAULTS
from haptic_display.client import Client
from haptic_display.fault_sentence import BUTTON, PRESS, cause, fell, steps
from haptic_display.page.settings import DRIVER, LOOPBACK, RECORDER, SIMULATION
from haptic_display.page.state import SILENT, State

if TYPE_CHECKING:  # it starts nodes
    from haptic_display.page.node_manager import NodeManager

NAMES = {DRIVER: "driver", SIMULATION: "simulation", LOOPBACK: "device", RECORDER: "recorder"}
NAMES |= {"haptic_bridge": "bridge of the device", "haptic_relay": "relay"}
WATCHED = (DRIVER, SIMULATION, LOOPBACK, "haptic_bridge")  # silent, they are missed; whoever records may stop
LAST_WORDS = 0.7  # s: what is heard of a node that long after its end is of another one
STANDS = 0.3  # s that a trouble stands before it is told in the terminal: by then its number is known


class Trouble(NamedTuple):
    """title, cause and first step as sentences; button: what it is called, "" where the page can do nothing; nodes: to
    be started again; fault: its name, or ""; told: the sentence for a terminal."""

    title: str
    cause: str
    first: str
    button: str
    nodes: tuple[str, ...] = ()
    fault: str = ""
    told: str = ""


class TroubleFinder:
    """`trouble` is as of the last look, None if all is well. nodes: those that are this process's to start again."""

    def __init__(self, state: State, client: Client, nodes: "NodeManager | None" = None):
        self.trouble: Trouble | None = None
        self._state, self._client, self._nodes = state, client, nodes
        self._ended: dict[str, float] = {}
        self._since = 0.0
        self._told: str | None = None

    def look(self, held: bool) -> None:
        """Finds what is wrong now. held: somebody is mending it, and it stays until that is done."""
        now = time.monotonic()
        before = self.trouble
        if not (held and before):
            self.trouble = self._of_nodes(now) or self._of_fault()
        if self._title(self.trouble) != self._title(before):
            self._since = now

    def news(self) -> str:
        """A sentence for the terminal, once for each trouble."""
        if self.trouble is None:
            self._told = None
        elif self._told != self._title(self.trouble) and time.monotonic() > self._since + STANDS:
            self._told = self._title(self.trouble)
            return self.trouble.told
        return ""

    def _title(self, trouble: Trouble | None) -> str | None:
        return trouble.title if trouble else None

    def _of_nodes(self, now: float) -> Trouble | None:
        if self._nodes and self._nodes.changing:
            return None
        ended = self._ended_nodes(now)
        silent = {
            name: f"nothing was heard of {name} for {SILENT:g} s"
            for name in WATCHED
            if name in self._client.statuses and name not in self._state.statuses and name not in ended
        }
        found = ended | silent
        if not found:
            return None
        said = _of(ended, "has ended", "have ended"), _of(silent, "does not answer", "do not answer")
        title, why = ". ".join(filter(None, said)), "; ".join(found.values())
        button = f"Start {named(found)} again" if self._nodes else ""
        commands = ", ".join(map(self._command, found))
        first = "" if button else f"Start again, with the file it was started with: {commands}"
        told = f"{title}: {why}. " + (f'Press "{button}" on the page.' if button else f"{first}.")
        return Trouble(title, f"{why}.", first, button, tuple(found), told=told)

    def _command(self, name: str) -> str:
        return f"ros2 run haptic_display {name} --ros-args -r __ns:={self._client.node.get_namespace()}"

    def _ended_nodes(self, now: float) -> dict[str, str]:
        """{name: how} of those that ended and that nobody else has started again."""
        ended = self._nodes.ended() if self._nodes else {}
        self._ended = {name: self._ended.get(name, now) for name in ended}
        return {
            name: how
            for name, how in ended.items()
            if self._client.heard.get(name, 0.0) < self._ended[name] + LAST_WORDS
        }

    def _of_fault(self) -> Trouble | None:
        name, number, first = (self._state.said(DRIVER, f"fault{entry}") for entry in ("", "_detail", "_first"))
        if name not in FAULTS:
            return None
        told = f"{fell(name, number)}. {steps(name, f'{PRESS} on the page', first)}"
        why = f"{_capital(cause(name, number))}."
        first = _capital(first or FAULTS[name].first)  # what to press then is written on the button
        return Trouble(FAULTS[name].title, why, first and f"{first}.", BUTTON, fault=name, told=told)


def named(nodes: Collection[str]) -> str:
    """One node by its name, or "the nodes"."""
    return "the nodes" if len(nodes) > 1 else f"the {NAMES.get(*nodes, *nodes)}"


def _of(nodes: Collection[str], one: str, many: str) -> str:
    return _capital(f"{named(nodes)} {many if len(nodes) > 1 else one}") if nodes else ""


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
