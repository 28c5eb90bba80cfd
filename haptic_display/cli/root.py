# SPDX-License-Identifier: Apache-2.0
"""What `haptic` takes before the name of a command, and how it lists the commands."""

from itertools import groupby
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

PACKAGE = "haptic_display"


class Panels(TyperGroup):
    """Lists commands by their job, in plain text: rich, which would draw the panels, takes long to import."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """A section for each panel, in the order of the commands."""
        width = max(map(len, self.commands))
        limit = formatter.width - width - 6  # the rest of a line, as without panels
        for panel, inside in groupby(self.commands.items(), lambda item: getattr(item[1], "rich_help_panel", None)):
            with formatter.section(panel or "Commands"):
                formatter.write_dl([(name.ljust(width), each.get_short_help_str(limit)) for name, each in inside])


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"{PACKAGE} {_version()}")
        raise typer.Exit


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version  # which takes time

    try:
        return version(PACKAGE)
    except PackageNotFoundError:
        return "of a source tree that is not installed"


_VERSION = typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and end.")


def options(version: Annotated[bool, _VERSION] = False) -> None:
    """The options of `haptic` itself."""
