# SPDX-License-Identifier: Apache-2.0
"""The stored references made again: converged solutions of the cases without a closed form."""

from typing import Annotated

import typer

from reference.case import NAMES, case
from reference.reference import CLOSED, make, write


def main(
    names: Annotated[list[str] | None, typer.Argument(help="Cases [all without a closed form].")] = None,
) -> None:
    """Make the stored references again, some minutes."""
    for name in names or [name for name in NAMES if name not in CLOSED]:
        found = case(name)
        if name in CLOSED:
            raise ValueError(f"scene {name!r} has a closed form; there is nothing to store")
        made = make(found)
        typer.echo(f"{write(name, made)}  may be off by {made.doubt:.1e} m")
