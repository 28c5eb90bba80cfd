# SPDX-License-Identifier: Apache-2.0
"""`haptic bench`: measurements of the display, one subcommand each; the one that runs is imported when it runs."""

import importlib

import typer

COMMANDS = {
    "all": "bench.all:run_all",
    "costs": "haptic_sim.cli.bench_costs:costs",
    "exchange": "bench.exchange.exchange:exchange",
    "growth": "haptic_sim.cli.bench_growth:growth",
    "hard-cases": "bench.methods.hard_cases:hard_cases",
    "load": "bench.servo.load:load",
    "local": "bench.exchange.local:local",
    "reference": "bench.methods.speed_error:reference",
    "servo": "bench.servo.servo:servo",
    "speed-error": "bench.methods.speed_error:speed_error",
    "start": "bench.servo.start:start",
}


def group() -> typer.Typer:
    """The typer group with all its subcommands."""
    app = typer.Typer(no_args_is_help=True, help="Measure the display: servo, exchange, start-up, simulation methods.")
    app.callback()(lambda: None)
    for name, where in COMMANDS.items():
        module, function = where.split(":")
        app.command(name)(getattr(importlib.import_module(module), function))
    return app
