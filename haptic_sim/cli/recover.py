# SPDX-License-Identifier: Apache-2.0
"""`haptic recover`: a bag whose recorder died becomes a whole one again, where it lies."""

from pathlib import Path
from typing import Annotated

import typer


def recover(bag: Annotated[Path, typer.Argument(help="Folder of a bag, or one .mcap file.")]) -> None:
    """Repair a bag that was cut off or damaged: its files get their index, its folder metadata.yaml.

    A file that is whole stays as it is. Exit code 1 if there is nothing to repair from.
    """
    from haptic_device.recording.recover import recovered

    for sentence in recovered(bag):
        typer.echo(sentence)
