# SPDX-License-Identifier: Apache-2.0
"""`haptic view`: the page for a running system."""

from typing import Annotated

import typer

from haptic_display.cli.keys import stop_key
from haptic_display.cli.numbers import whole
from haptic_display.page.kept_tokens import forget
from haptic_display.run.processes import NAMESPACE, ros_arguments
from haptic_sim.node.parameters import HOME_PORT


def view(
    namespace: Annotated[str, typer.Option(help="Namespace of the system.")] = NAMESPACE,
    host: Annotated[str, typer.Option(help="Address to listen on; beyond this machine it warns.")] = "127.0.0.1",
    port: Annotated[int, whole(0, 65535, help="TCP port; 0: any that is free.")] = HOME_PORT,
    new_link: Annotated[bool, typer.Option("--new-link", help="New links; the old ones open nothing more.")] = False,
) -> None:
    """Show a running system on a local web page, where the mouse is the hand. Ctrl-C is the normal end."""
    from haptic_display.page.viewer import main

    if new_link:
        forget()
    with stop_key() as stop:
        code = main(ros_arguments(namespace, {"host": host, "port": port}), stop)
    if code:
        raise typer.Exit(code)
