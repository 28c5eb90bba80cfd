# SPDX-License-Identifier: Apache-2.0
"""`haptic recover`: a bag whose recorder died becomes a whole one again."""

from pathlib import Path
from typing import Annotated

import typer

from haptic_sim.cli.words import next_step, shown_path


def recover(bag: Annotated[Path, typer.Argument(help="Folder of a bag, or one .mcap file.")]) -> None:
    """Make a bag whole that was cut off or damaged: its files anew from what can be read, metadata.yaml beside them.

    A file that is whole stays as it is; one that is not stays as NAME.damaged. Exit code 1 if there is nothing to read.
    """
    from haptic_device.recording.recover import recovered

    for sentence in recovered(bag):
        typer.echo(sentence)
    next_step(f"haptic report {shown_path(bag)}")
