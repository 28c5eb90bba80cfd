# SPDX-License-Identifier: Apache-2.0
"""How late the servo wakes, beside cyclictest."""

import json
import statistics
import sys
from typing import Annotated

import typer

from bench.jobs import markdown, medians
from bench.servo.cyclictest import cyclictest, why_missing
from haptic_display.run.lateness import RATES, alone

QUANTITIES = ("ticks", "missed", "p50", "p99", "p999", "max")
_RATE = "Servo rate [Hz], 500 to 10000; may be repeated [1000 2000 4000 8000 10000]."
_TURNS = "Turns, servo and cyclictest one after the other; medians count."


def main(
    rate: Annotated[list[float] | None, typer.Option(help=_RATE, min=500.0, max=10000.0)] = None,
    seconds: Annotated[float, typer.Option(help="Length of a measurement.", min=0.2, max=3600.0)] = 2.0,
    turns: Annotated[int, typer.Option(help=_TURNS, min=1, max=100)] = 5,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Lateness of the servo with real-time priority and without, beside cyclictest."""
    cases = lateness(rate or RATES, seconds, turns)
    for lack in _lacking(cases):
        typer.echo(f"bench: {lack}", err=True)
    typer.echo(json.dumps({"lateness": cases}) if as_json else table(cases))


def lateness(rates, seconds: float, turns: int) -> list[dict]:
    """One entry a rate and scheduling: medians over the turns [us]."""
    cases = []
    for rate in rates:
        for realtime in ("prefer", "off"):
            print(f"{rate:g} Hz, realtime {realtime}", file=sys.stderr, flush=True)
            wanted = rate, seconds, realtime
            pairs = [(alone(*wanted)[0], cyclictest(*wanted)) for _ in range(turns)]
            cases.append({"rate": rate, "realtime": realtime, **_medians(pairs)})
    return cases


def _medians(pairs):
    ours = [one.figures() for one, _ in pairs]
    both = [(one.figures(), other.figures()) for one, other in pairs if other is not None]
    found = medians(ours, QUANTITIES) | {"scheduling": ours[0]["scheduling"]}
    if not both:
        return found | {"cyclictest": None, "p99_ratio": None}
    ratio = statistics.median(a["p99"] / max(1.0, b["p99"]) for a, b in both)
    return found | {"cyclictest": medians([other for _, other in both], QUANTITIES), "p99_ratio": ratio}


def _lacking(cases):
    """What there was no cyclictest or no real-time priority for, a sentence each."""
    if any(case["cyclictest"] is None for case in cases):
        yield why_missing()
    yield from sorted({case["scheduling"] for case in cases if "no SCHED_FIFO" in case["scheduling"]})


def table(cases: list[dict]) -> str:
    """The lateness as a table of Markdown."""
    figures = ("p50", "p99", "p99.9", "max us", "missed")
    heads = ("rate Hz", "real-time", *figures, *(f"cyclictest {figures[0]}", *figures[1:]), "p99 ratio")
    return markdown(
        heads,
        [
            [case["rate"], case["realtime"], *_numbers(case), *_numbers(case["cyclictest"]), case["p99_ratio"]]
            for case in cases
        ],
    )


def _numbers(one):
    if one is None:
        return [None] * 5
    return [*(one[name] for name in ("p50", "p99", "p999", "max")), f"{one['missed']:g} of {one['ticks']:g}"]
