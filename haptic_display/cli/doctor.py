# SPDX-License-Identifier: Apache-2.0
"""`haptic doctor`: what this machine can hold, which rates to choose, and how to get more."""

import json
from typing import Annotated

import typer

from haptic_device.digits import amount
from haptic_display.cli.numbers import number
from haptic_display.cli.words import console, next_step, table

TITLE = "How late the servo wakes up"
MACHINE = "", "this machine", "found, and how to get more"
LATE = "rate [Hz]", "median", "99 %", "99.9 %", "largest", "missed", "scheduling"


def doctor(
    seconds: Annotated[float, number("s", 0.2, 60.0, help="Length of the trial at each servo rate.")] = 1.0,
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
    machine = table(MACHINE, map(_checked, found["checks"]), title="What this machine lets a servo have")
    machine.columns[-1].overflow = "fold"
    out, chosen = console(), found["choose"]
    out.print(machine, table(LATE, (_late(*trial) for trial in found["servo"].items()), title=TITLE))
    out.print(
        f"an exchange of peg_in_hole takes {amount(found['exchange_us_p99'] * 1e-6, 's')} (99 %)\n"
        f"choose servo.rate {chosen['servo.rate']} Hz and exchange.rate {chosen['exchange.rate']} Hz",
        highlight=False,
    )


def _checked(one):
    if one["good"]:
        return ("ok", "green"), one["name"], one["found"]
    return ("warn", "yellow"), one["name"], f"{one['found']}\n{one['advice']}"


def _late(rate, one):
    times = (amount(one[name] * 1e-6, "s") for name in ("p50", "p99", "p999", "max"))
    return str(rate), *times, f"{one['missed']} of {one['ticks']}", str(one["scheduling"])
