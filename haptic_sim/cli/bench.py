# SPDX-License-Identifier: Apache-2.0
"""`haptic bench`: measurements of the display, one subcommand each; the one that runs is imported when it runs."""

import importlib

import typer

COMMANDS = {
    "exchange": "haptic_sim.cli.bench_exchange:exchange",
    "hard-cases": "haptic_sim.cli.bench_hard_cases:hard_cases",
    "local": "haptic_sim.cli.bench_local:local",
    "reference": "haptic_sim.cli.bench_speed_error:reference",
    "speed-error": "haptic_sim.cli.bench_speed_error:speed_error",
}


def group() -> typer.Typer:
    """The typer group with all its subcommands."""
    app = typer.Typer(no_args_is_help=True, help="Measure the display in lock-step: exchange methods, methods, speed.")
    app.callback()(lambda: None)
    for name, where in COMMANDS.items():
        module, function = where.split(":")
        app.command(name)(getattr(importlib.import_module(module), function))
    return app
