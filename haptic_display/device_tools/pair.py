# SPDX-License-Identifier: Apache-2.0
"""Driver and loopback for a tool: the ones that run, or a pair of the tool's own in a domain of its own."""

import contextlib
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from haptic_device import ros_environment
from haptic_device.process import say
from haptic_display.device_tools.tuning import Check, FaultError
from haptic_display.fault_sentence import fell
from haptic_display.run.device_programs import device_programs
from haptic_display.run.domain import isolated_domain
from haptic_display.run.prepare import prepare
from haptic_display.run.processes import NAMESPACE, Nodes, Program

Values = dict[str, Any]
Work = Callable[[int, str, Check], Any]


def on_pair(domain: int | None, namespace: str | None, driver: Values, loopback: Values, work: Work) -> Any:
    """What work(domain, namespace, check) gives on the `running` pair.

    Where the driver of a pair that is started here falls into a fault, as on a machine that does much else, this is
    said, and all is done once more on a new pair. ValueError if that falls into a fault too; FaultError of nodes that
    are somebody else's.
    """

    def once() -> Any:
        with running(domain, namespace, driver, loopback) as given:
            return work(*given)

    try:
        return once()
    except FaultError as found:
        if domain is not None or namespace is not None:
            raise
        say(f"{fell(found.fault)}; both nodes are started anew")
    try:
        return once()
    except FaultError as found:
        todo = "end what else keeps the machine busy, or take a lower servo rate or less force"
        raise ValueError(f"{fell(found.fault)} again: {todo}") from None


@contextlib.contextmanager
def running(
    domain: int | None, namespace: str | None, driver: Values, loopback: Values
) -> Iterator[tuple[int, str, Check]]:
    """Yields (domain, namespace, check): of the nodes that run there if either is given, else of a pair started here.

    check() raises if a node of the pair has ended, and gives the last line that each node of it printed.
    """
    if domain is not None or namespace is not None:
        yield ros_environment.domain() if domain is None else domain, namespace or NAMESPACE, dict
        return
    with contextlib.ExitStack() as stack:
        logs = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="haptic_")))
        number = stack.enter_context(isolated_domain(logs))
        yield number, NAMESPACE, _start(stack.enter_context(Nodes(logs)), driver, loopback, logs)


def _start(nodes: Nodes, driver: Values, loopback: Values, logs: Path) -> Check:
    hand = {name: value for name, value in loopback.items() if name != "device"}
    programs = [
        *device_programs(loopback["device"], hand, logs),
        Program("haptic_driver", "haptic_device.nodes.driver", {"auto_enable": True, **driver}),
    ]
    prepare(programs)
    for program in programs:
        nodes.start(program)
    return nodes.check
