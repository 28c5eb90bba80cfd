# SPDX-License-Identifier: Apache-2.0
"""The `haptic` command. One file a subcommand; only the one that runs is imported, so `haptic check` needs no ROS."""

import contextlib
import importlib
import os
import sys

from haptic_device import ros_environment
from haptic_device.os_errors import in_words
from haptic_device.process import handling, say
from haptic_display.cli.completion import COMPLETING, completed_words
from haptic_display.cli.progress import INTERRUPTED

COMMANDS = {  # name: (module and function, what it does), by the job
    "demo": ("haptic_display.cli.demo:demo", "Run a whole display on a scene."),
    "view": ("haptic_display.cli.view:view", "Show a running display on a web page."),
    "status": ("haptic_display.cli.status:status", "Show a running display, with keys that stop it."),
    "scenes": ("haptic_display.cli.scenes:scenes", "List, draw and explain scenes."),
    "get": ("haptic_display.cli.parameters:get", "Print the parameters of a running node."),
    "set": ("haptic_display.cli.parameters:set_value", "Set a parameter of a running node."),
    "save": ("haptic_display.cli.parameters:save", "Write the parameters of a running display to a file."),
    "passivity": ("haptic_display.cli.passivity:passivity", "Compute whether gains are passive and stable."),
    "zwidth": ("haptic_display.cli.zwidth:zwidth", "Find the stiffest walls that a device can show."),
    "docs": ("haptic_display.cli.docs:docs", "Print the table of all parameters, or of all faults."),
    "record": ("haptic_display.cli.record:record", "Record a running display."),
    "mark": ("haptic_display.cli.mark:mark", "Put a marker into the recording that runs."),
    "report": ("haptic_display.cli.report:report", "Write a page about recordings."),
    "replay": ("haptic_display.cli.replay:replay", "Play a recorded motion again."),
    "compare": ("haptic_display.cli.compare:compare", "Play one recorded motion at several operating points."),
    "device": ("haptic_display.cli.device:device", "Find, show, describe and test a device of your own."),
    "identify": ("haptic_display.cli.identify:identify", "Measure mass, damping and friction of a device."),
    "check": ("haptic_display.cli.check:check", "Say whether files are right; measure scenes."),
    "doctor": ("haptic_display.cli.doctor:doctor", "Say which servo rate this machine can hold."),
    "compile": ("haptic_display.cli.compile:compile", "Compile the kernels for this machine."),
}
PANELS = {"demo": "See and feel", "get": "Tune", "record": "Record and analyse", "device": "Devices", "check": "Check"}
"""The first command of each job, and the job."""
FIRST = "Begin with: haptic demo --view"
STARTING = ("demo", "record", "view")  # nodes, or a page, before ROS is loaded
BENCH = "measurements are no part of what is installed; python -m bench, in a clone of the sources, lists and runs them"
ROS_MISSING = "ROS 2 Jazzy is missing: pip install '.[ros]' in the clone, or source an installed ROS 2 first"


def main():
    """Entry point. Bad input ends in one sentence on standard error and exit code 1, never in a traceback."""
    with ending_in_a_sentence("haptic"):
        words = completed_words() if COMPLETING in os.environ else sys.argv[1:]
        if words[:1] == ["bench"]:
            raise ValueError(BENCH)
        with handling(lambda number, frame: os._exit(INTERRUPTED)):  # some imports would lose a KeyboardInterrupt
            application = _application(next((word for word in words if not word.startswith("-")), ""))
        if COMPLETING not in os.environ:
            _prepare(words)
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


def _application(wanted: str):
    """The typer application with the wanted command, or with the names of all if it is none of them, as for --help."""
    import typer  # here, where a signal is heard

    from haptic_display.cli.root import Panels, options

    app = typer.Typer(
        cls=Panels,
        no_args_is_help=True,
        add_completion=wanted not in COMMANDS or COMPLETING in os.environ,  # its import takes time
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(help="Feel a simulated tool through a haptic handle.", epilog=FIRST)(options)
    if wanted not in COMMANDS:
        panel = ""
        for name, (_, what) in COMMANDS.items():
            panel = PANELS.get(name, panel)
            app.command(name, short_help=what, rich_help_panel=panel)(lambda: None)
        return app
    module, function = COMMANDS[wanted][0].split(":")
    command = getattr(importlib.import_module(module), function)
    if isinstance(command, typer.Typer):  # a group of commands
        app.add_typer(command, name=wanted)
    else:
        negative = {"ignore_unknown_options": wanted == "set"}  # -1.0 is a value
        app.command(wanted, context_settings=negative)(command)
    return app


def _prepare(words):
    """Refuses what ROS would not survive; has kernels that a command calls itself, those of nodes are for who starts
    them."""
    if not words or {"-h", "--help"} & set(words):
        return
    if words[0] in STARTING:
        ros_environment.check()
        ros_environment.check_room()
    if words[0] in ("compare", "identify", "replay", "zwidth"):
        from haptic_device.jit import ensure_compiled
        from haptic_display.run.prepare import COMMANDS

        ensure_compiled(*COMMANDS[words[0]])


def _refuse(name, reason):
    say(f"{name}: {reason}")
    sys.exit(1)


if __name__ == "__main__":
    main()
