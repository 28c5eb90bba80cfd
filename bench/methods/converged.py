# SPDX-License-Identifier: Apache-2.0
"""The stored references made again: converged solutions of the cases without a closed form."""

from typing import Annotated

import typer

from bench.reference.case import NAMES, case
from bench.reference.reference import CLOSED, make, write


def main(names: Annotated[list[str] | None, typer.Argument(help="Cases [all without a closed form].")] = None) -> None:
    """Make the stored references again, some minutes."""
    asked = {name: case(name) for name in names or NAMES if names or name not in CLOSED}
    for name in CLOSED.keys() & asked:
        raise ValueError(f"scene {name!r} has a closed form; there is nothing to store")
    for name, found in asked.items():
        made = make(found)
        typer.echo(f"{write(name, made)}  may be off by {made.doubt:.1e} m")
