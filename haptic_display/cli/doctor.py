# SPDX-License-Identifier: Apache-2.0
"""`haptic doctor`: what this machine can hold, which rates to choose, and how to get more."""

import json
from typing import Annotated

import typer

from haptic_device.digits import amount
from haptic_display.cli.numbers import number
from haptic_display.cli.words import console, next_step

TITLE = "How late the servo wakes up"


def doctor(
    seconds: Annotated[
        float, number("--seconds", "s", 0.2, 60.0, help="Length of the trial at each servo rate.")
    ] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """What this machine can hold: scheduling, cores, clock; servo and exchange rate to choose; how to get more."""
    from haptic_display.run.machine_trial import examine

    found = examine(seconds)
    if as_json:
        typer.echo(json.dumps(found))
        return
    _show(found)
    chosen = found["choose"]
    next_step(f"haptic demo --rate {chosen['servo.rate']}; exchange.rate goes into a file for --params")


def _show(found):
    from rich.table import Table
    from rich.text import Text

    machine = Table("", "this machine", "found, and how to get more", title="What this machine lets a servo have")
    for check in found["checks"]:
        verdict = Text("ok", "green") if check["good"] else Text("warn", "yellow")
        said = check["found"] if check["good"] else f"{check['found']}\n{check['advice']}"
        machine.add_row(verdict, check["name"], Text(said, overflow="fold"))
    late = Table("rate [Hz]", "median", "99 %", "99.9 %", "largest", "missed", "scheduling", title=TITLE)
    for rate, one in found["servo"].items():
        times = (amount(one[name] * 1e-6, "s") for name in ("p50", "p99", "p999", "max"))
        late.add_row(str(rate), *times, f"{one['missed']} of {one['ticks']}", Text(str(one["scheduling"])))
    out, chosen = console(), found["choose"]
    out.print(machine, late)
    out.print(
        f"an exchange of peg_in_hole takes {amount(found['exchange_us_p99'] * 1e-6, 's')} (99 %)\n"
        f"choose servo.rate {chosen['servo.rate']} Hz and exchange.rate {chosen['exchange.rate']} Hz",
        highlight=False,
    )
