# SPDX-License-Identifier: Apache-2.0
"""`haptic bench`: measurements of the display, one subcommand each; the one that runs is imported when it runs."""

import importlib

import typer

COMMANDS = {
    "all": "haptic_sim.cli.bench_all:run_all",
    "costs": "haptic_sim.cli.bench_costs:costs",
    "exchange": "haptic_sim.cli.bench_exchange:exchange",
    "growth": "haptic_sim.cli.bench_growth:growth",
    "hard-cases": "haptic_sim.cli.bench_hard_cases:hard_cases",
    "load": "haptic_sim.cli.bench_load:load",
    "local": "haptic_sim.cli.bench_local:local",
    "reference": "haptic_sim.cli.bench_speed_error:reference",
    "servo": "haptic_sim.cli.bench_servo:servo",
    "speed-error": "haptic_sim.cli.bench_speed_error:speed_error",
    "start": "haptic_sim.cli.bench_start:start",
}


def group() -> typer.Typer:
    """The typer group with all its subcommands."""
    app = typer.Typer(no_args_is_help=True, help="Measure the display: servo, exchange, start-up, simulation methods.")
    app.callback()(lambda: None)
    for name, where in COMMANDS.items():
        module, function = where.split(":")
        app.command(name)(getattr(importlib.import_module(module), function))
    return app
