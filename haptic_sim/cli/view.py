# SPDX-License-Identifier: Apache-2.0
"""`haptic view`: the page for a running system."""

from typing import Annotated

import typer

from haptic_sim.cli.processes import NAMESPACE, parameter_text


def view(
    namespace: Annotated[str, typer.Option(help="Namespace of the system.")] = NAMESPACE,
    host: Annotated[str, typer.Option(help="Address to listen on; beyond this machine it warns.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port; 0: any that is free.")] = 0,
) -> None:
    """Show a running system on a local web page, where the mouse is the hand. Ctrl-C is the normal end."""
    from haptic_sim.viewer.viewer import main

    code = main(arguments(namespace, {"host": host, "port": port}))
    if code:
        raise typer.Exit(code)


def arguments(namespace: str, values: dict) -> list[str]:
    """ROS arguments of a viewer."""
    given = [word for name, value in values.items() for word in ("-p", f"{name}:={parameter_text(value)}")]
    return ["--ros-args", "--disable-external-lib-logs", "-r", f"__ns:={namespace}", *given]
