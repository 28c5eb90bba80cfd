# SPDX-License-Identifier: Apache-2.0
"""`haptic doctor`: what this machine can hold, which rates to choose, and how to get more."""

import json
from typing import Annotated

import typer

from haptic_sim.cli.numbers import number


def doctor(
    seconds: Annotated[
        float, number("--seconds", "s", 0.2, 60.0, help="Length of the trial at each servo rate.")
    ] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """What this machine can hold: scheduling, cores, clock; servo and exchange rate to choose; how to get more."""
    from haptic_sim.supervision.machine_trial import examine

    found = examine(seconds)
    typer.echo(json.dumps(found)) if as_json else _show(found)


def _show(found):
    for check in found["checks"]:
        typer.echo(f"{'ok  ' if check['good'] else 'more'} {check['name']:20} {check['found']}")
        if not check["good"]:
            typer.echo(f"     {'':20} {check['advice']}")
    typer.echo(f"\n{'servo rate':>10} {'p50':>8} {'p99':>8} {'p99.9':>8} {'max':>9} us late {'missed':>7}  scheduling")
    for rate, one in found["servo"].items():
        numbers = " ".join(f"{one[name]:8.1f}" for name in ("p50", "p99", "p999"))
        typer.echo(f"{rate:7} Hz {numbers} {one['max']:9.1f}         {one['missed']:7}  {one['scheduling']}")
    chosen = found["choose"]
    typer.echo(
        f"\nan exchange of peg_in_hole takes {found['exchange_us_p99']:.0f} us (p99)\n"
        f"choose servo.rate {chosen['servo.rate']} and exchange.rate {chosen['exchange.rate']}"
    )
