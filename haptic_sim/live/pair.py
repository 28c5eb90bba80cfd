# SPDX-License-Identifier: Apache-2.0
"""Driver and loopback for a tool: the ones that run, or a pair of the tool's own in a domain of its own."""

import contextlib
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from haptic_sim.live.domain import current_domain, isolated_domain
from haptic_sim.live.prepare import prepare
from haptic_sim.live.processes import NAMESPACE, Nodes, Program


@contextlib.contextmanager
def running(domain: int | None, namespace: str | None, driver: dict, loopback: dict) -> Iterator[tuple]:
    """Yields (domain, namespace, check): of the nodes that run there if either is given, else of a pair started here.

    check() raises if a node of the pair has ended.
    """
    if domain is not None or namespace is not None:
        yield domain or current_domain(), namespace or NAMESPACE, lambda: None
        return
    with contextlib.ExitStack() as stack:
        logs = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="haptic_")))
        number = stack.enter_context(isolated_domain(logs))
        yield number, NAMESPACE, _start(stack.enter_context(Nodes(logs)), driver, loopback)


def _start(nodes: Nodes, driver: dict, loopback: dict) -> Callable[[], None]:
    programs = [
        Program("haptic_loopback", "haptic_device.nodes.loopback", loopback),
        Program("haptic_driver", "haptic_device.nodes.driver", {"auto_enable": True, **driver}),
    ]
    prepare(programs)
    for program in programs:
        nodes.start(program)
    return nodes.check
