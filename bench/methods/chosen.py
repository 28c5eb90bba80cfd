# SPDX-License-Identifier: Apache-2.0
"""Every method that a shipped scene could have, as `haptic check --verify` measures it, against its reference."""

from pathlib import Path
from typing import Annotated

import typer

from bench.methods import hard_cases
from bench.reference.case import NAMES, case
from bench.reference.reference import reference
from haptic_display.cli.check import ALL, verify_scenes
from haptic_sim.lockstep.verify import LOOK, case_of, verify


def main(
    scene: Annotated[str, typer.Argument(help=f"A scene, or `{ALL}`.")] = ALL,
    out: Annotated[Path | None, typer.Option(help="CSV file whose rows of these scenes are measured anew.")] = None,
) -> None:
    """Error against closed forms and stored references; hard scenes as `hard_cases` leads them.

    `--out haptic_sim/reduction/measured.csv` makes the table anew that `haptic scenes --explain` shows.
    """
    verify_scenes([scene], out, _measured)


def _measured(name):
    if name in NAMES:
        return verify(case(name), reference(name))
    return verify(hard_cases.case(name, LOOK) if name in hard_cases.NAMES else case_of(name))
