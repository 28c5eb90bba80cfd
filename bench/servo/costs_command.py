# SPDX-License-Identifier: Apache-2.0
"""`haptic bench costs`: the cost model, measured on this machine."""

import json
from typing import Annotated

import typer


def costs(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """What a tick, an exchange, a sub-step and a cell cost, and how each grows with axes, walls, blocks, contacts."""
    from haptic_device.runtime.machine import cores
    from bench.servo.costs import efficiency, measure

    found = {"costs": [one._asdict() for one in measure()], "two_cores": efficiency(2) if cores() > 1 else None}
    typer.echo(json.dumps(found) if as_json else table(found))


def table(found: dict) -> str:
    """As a table of Markdown, and a sentence on the cores."""
    lines = [
        "| what | at none [us] | for one more [us] | | off the line |",
        "| --- | --- | --- | --- | --- |",
    ]
    for one in found["costs"]:
        numbers = f"{one['base']:.3g} | {one['slope']:.3g} | {one['grows_with']}"
        lines.append(f"| {one['what']} | {numbers} | {100.0 * one['apart']:.1f} % |")
    shared = found["two_cores"]
    said = "one core only: no efficiency" if shared is None else f"two cores do {2.0 * shared:.2f} times the map of one"
    return "\n".join([*lines, "", said])
