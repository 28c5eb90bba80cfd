# SPDX-License-Identifier: Apache-2.0
"""What a shell completes: commands, and names of scenes, operating points, devices, methods, nodes and parameters."""

import os
from collections.abc import Callable, Iterable

COMPLETING = "_HAPTIC_COMPLETE"  # the shell's script sets it


def completed_words() -> list[str]:
    """The words after `haptic` on the line that a shell completes."""
    return (os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS", "")).split()[1:]


def shipped(folder: str) -> Callable[[str], list[str]]:
    """Completes a name in config/<folder>; "" is config/ itself."""

    def complete(incomplete: str) -> list[str]:
        from haptic_device.config.files import names

        return _begin(names(folder), incomplete)

    return complete


def exchange_method(incomplete: str) -> list[str]:
    """Completes an exchange method."""
    from haptic_device.config.parameters import EXCHANGE_METHODS

    return _begin(EXCHANGE_METHODS, incomplete)


def node_name(incomplete: str) -> list[str]:
    """Completes the name of a node."""
    from haptic_sim.node.parameters import NODES

    return _begin(NODES, incomplete)


def parameter(live: bool) -> Callable[[str], list[str]]:
    """Completes the name of a parameter of the node that stands before it; live: of those that may change."""

    def complete(incomplete: str) -> list[str]:
        from haptic_sim.node.parameters import NODES

        words = completed_words()
        declared = NODES.get(words[1] if len(words) > 1 else "", ())
        return _begin((each.name for each in declared if each.live or not live), incomplete)

    return complete


def _begin(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
