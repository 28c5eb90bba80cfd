# SPDX-License-Identifier: Apache-2.0
"""The `haptic` command. One file a subcommand; only the one that runs is imported, so `haptic check` needs no ROS."""

import contextlib
import importlib
import os
import sys

from haptic_device import ros_environment
from haptic_device.os_errors import in_words
from haptic_device.process import handling
from haptic_sim.cli.progress import INTERRUPTED

COMMANDS = {
    "check": "haptic_sim.cli.check:check",
    "compile": "haptic_sim.cli.compile:compile",
    "compare": "haptic_sim.cli.compare:compare",
    "demo": "haptic_sim.cli.demo:demo",
    "device": "haptic_sim.cli.device:device",
    "docs": "haptic_sim.cli.docs:docs",
    "doctor": "haptic_sim.cli.doctor:doctor",
    "get": "haptic_sim.cli.parameters:get",
    "identify": "haptic_sim.cli.identify:identify",
    "mark": "haptic_sim.cli.mark:mark",
    "passivity": "haptic_sim.cli.passivity:passivity",
    "record": "haptic_sim.cli.record:record",
    "recover": "haptic_sim.cli.recover:recover",
    "replay": "haptic_sim.cli.replay:replay",
    "report": "haptic_sim.cli.report:report",
    "save": "haptic_sim.cli.parameters:save",
    "scenes": "haptic_sim.cli.scenes:scenes",
    "set": "haptic_sim.cli.parameters:set_value",
    "status": "haptic_sim.cli.status:status",
    "view": "haptic_sim.cli.view:view",
    "zwidth": "haptic_sim.cli.zwidth:zwidth",
}
STARTING = ("demo", "record", "view")  # nodes, or a page, before ROS is loaded
BENCH = "measurements are no part of what is installed; python -m bench, in a clone of the sources, lists and runs them"
ROS_MISSING = "ROS 2 Jazzy is missing: pip install '.[ros]' in the clone, or source an installed ROS 2 first"


def main():
    """Entry point. Bad input ends in one sentence on standard error and exit code 1, never in a traceback."""
    with ending_in_a_sentence("haptic"):
        if sys.argv[1:2] == ["bench"]:
            raise ValueError(BENCH)
        with handling(lambda number, frame: os._exit(INTERRUPTED)):  # some imports would lose a KeyboardInterrupt
            application = _application(sys.argv[1:2])
        _prepare(sys.argv[1:])
        application(prog_name="haptic")


@contextlib.contextmanager
def ending_in_a_sentence(name: str):
    """What is refused meanwhile is said in one sentence that begins with `name`, exit code 1; interrupted: 130."""
    try:
        yield
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except (ValueError, OSError) as error:
        _refuse(name, in_words(error))
    except ModuleNotFoundError as error:
        if error.name != "rclpy":
            raise
        _refuse(name, ROS_MISSING)


def _application(wanted):
    """The typer application with the wanted subcommand, or with all of them if it is none of them, as for --help."""
    import typer  # here, where a signal is heard

    app = typer.Typer(no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    app.callback(help="Haptic display of tool use: run it, check its files, compute its bounds.")(lambda: None)
    for name in set(wanted) & set(COMMANDS) or COMMANDS:
        module, function = COMMANDS[name].split(":")
        command = getattr(importlib.import_module(module), function)
        if isinstance(command, typer.Typer):  # a group of commands
            app.add_typer(command, name=name)
            continue
        negative = {"ignore_unknown_options": name == "set"}  # -1.0 is a value
        app.command(name, context_settings=negative)(command)
    return app


def _prepare(words):
    """Refuses what ROS would not survive; has kernels that a command calls itself, those of nodes are for who starts
    them."""
    if not words or "--help" in words:
        return
    if words[0] in STARTING:
        ros_environment.check()
        ros_environment.check_room()
    if words[0] in ("compare", "identify", "replay", "zwidth"):
        from haptic_device.jit import ensure_compiled
        from haptic_sim.supervision.prepare import COMMANDS

        ensure_compiled(*COMMANDS[words[0]])


def _refuse(name, reason):
    print(f"{name}: {reason}", file=sys.stderr)
    sys.exit(1)


if __name__ == "__main__":
    main()
