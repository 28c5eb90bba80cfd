# SPDX-License-Identifier: Apache-2.0
"""`haptic docs`: writes docs/parameters.md from the declarations, so that the table cannot disagree with the nodes."""

import math
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.parameter import Parameter
from haptic_sim.cli.nodes import NODES

HEAD = """# Parameters

Generated from the declarations by `haptic docs --out docs/parameters.md`; do not edit.

A *live* parameter may be changed while the node runs (`ros2 param set`); the others are fixed at start. Numbers must be
written as their type: `300.0`, not `300`, for a decimal number. `haptic check FILE` tests a file against this table.
"""
COLUMNS = "| name | default | unit | allowed | live | meaning |\n|---|---|---|---|---|---|"


def docs(out: Annotated[Path | None, typer.Option(help="File to write; standard output if not given.")] = None):
    """Print the table of all parameters of all nodes as Markdown."""
    if out is None:
        typer.echo(markdown(NODES), nl=False)
    else:
        out.write_text(markdown(NODES), encoding="utf-8")


def markdown(nodes: dict[str, tuple[Parameter, ...]]) -> str:
    """The document for {node name: parameters}."""
    return HEAD + "".join(_section(node, parameters) for node, parameters in nodes.items())


def _section(node, parameters):
    rows = "\n".join(_row(parameter) for parameter in parameters)
    return f"\n## {node}\n\n{COLUMNS}\n{rows}\n"


def _row(parameter):
    live = "live" if parameter.live else ""
    name, default = f"`{parameter.name}`", f"`{_text(parameter.default)}`"
    cells = [name, default, parameter.unit, _allowed(parameter), live, parameter.meaning]
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _text(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_text(item) for item in value)}]"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _allowed(parameter):
    if parameter.choices:
        return ", ".join(f"`{choice}`" for choice in parameter.choices)
    low, high = math.isfinite(parameter.low), math.isfinite(parameter.high)
    if low and high:
        return f"{parameter.low} to {parameter.high}"
    return f"≥ {parameter.low}" if low else f"≤ {parameter.high}" if high else ""
