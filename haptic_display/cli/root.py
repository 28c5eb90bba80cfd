# SPDX-License-Identifier: Apache-2.0
"""What `haptic` takes before the name of a command."""

from typing import Annotated

import typer

PACKAGE = "haptic_display"


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
