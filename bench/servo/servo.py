# SPDX-License-Identifier: Apache-2.0
"""How late the servo wakes, beside cyclictest."""

import json
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from bench.jobs import deaths_told, markdown
from bench.servo import cyclictest
from haptic_device.analysis.report.summary import engaged_rows, faults
from haptic_device.config_files import find
from haptic_device.recording import load
from haptic_sim.cli import demo
from haptic_sim.supervision import lateness as servo_lateness
from haptic_sim.supervision.processes import NodeDiedError, interruptible
from haptic_sim.supervision.system import Order

QUANTITIES = ("ticks", "missed", "p50", "p99", "p999", "max")
_RATE = "Servo rate [Hz], 500 to 10000; may be repeated [1000 2000 4000 8000 10000]."
_DEMO = "Also under the whole demo (device, driver, simulation, recorder), for so many seconds a rate; 0: not."
_TURNS = "Turns, servo and cyclictest one after the other; medians count."


def main(
    rate: Annotated[list[float] | None, typer.Option(help=_RATE, min=500.0, max=10000.0)] = None,
    seconds: Annotated[float, typer.Option(help="Length of a measurement.", min=0.2, max=3600.0)] = 2.0,
    turns: Annotated[int, typer.Option(help=_TURNS, min=1, max=100)] = 5,
    demo_seconds: Annotated[float, typer.Option("--demo", help=_DEMO, min=0.0, max=3600.0)] = 0.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Lateness of the servo with real-time priority and without, beside cyclictest."""
    with interruptible(), deaths_told():
        cases = lateness(rate or servo_lateness.RATES, seconds, turns, demo_seconds)
    for lack in _lacking(cases):
        typer.echo(f"bench: {lack}", err=True)
    typer.echo(json.dumps({"lateness": cases}) if as_json else table(cases))


def lateness(rates, seconds: float, turns: int, beside_demo: float = 0.0) -> list[dict]:
    """One entry a rate, scheduling and load: medians over the turns [us].

    A demo that comes to nothing, as one without real-time priority may on a busy machine, is said and left out.
    """
    cases = []
    for rate in rates:
        for realtime in ("prefer", "off"):
            loads = {"alone": (seconds, turns, _alone)}
            loads |= {"demo": (beside_demo, 1, _under_demo)} if beside_demo else {}
            for beside, (length, times, measured) in loads.items():
                print(f"{rate:g} Hz, realtime {realtime}, {beside}", file=sys.stderr, flush=True)
                try:
                    pairs = [(measured(rate, length, realtime), _beside(rate, length, realtime)) for _ in range(times)]
                except (ValueError, NodeDiedError) as error:
                    if beside == "alone":
                        raise
                    print(f"bench: no demo at {rate:g} Hz, realtime {realtime}: {error}", file=sys.stderr)
                    continue
                cases.append({"rate": rate, "realtime": realtime, "load": beside, **_medians(pairs)})
    return cases


def _alone(rate, seconds, realtime):
    return servo_lateness.alone(rate, seconds, realtime)[0]


def _beside(rate, seconds, realtime):
    return cyclictest.cyclictest(rate, seconds, realtime)


def _under_demo(rate, seconds, realtime):
    """Of the driver of a whole demo, from its recording. Raises ValueError if a fault ended it before its time."""
    with tempfile.TemporaryDirectory(prefix="haptic_") as folder:
        wish = {"realtime": realtime}
        given = {name: wish for name in ("haptic_driver", "haptic_loopback", "haptic_simulation")}
        order = Order(
            "peg_in_hole", seconds, Path(folder) / "run", None, float(rate), find("", "demo").absolute(), None, given
        )
        demo.play(order)
        recording = load(order.out / "bag")
        said, rows = recording.last_values("haptic_driver").get("realtime", ""), engaged_rows(recording.trace)
        if found := faults(recording):
            raise ValueError(f"fault {', '.join(found)} after {len(rows) / rate:.1f} s of {seconds:g} s")
        return servo_lateness.lateness_of(rows, said)


def _medians(pairs):
    ours = [one.figures() for one, _ in pairs]
    both = [(one.figures(), other.figures()) for one, other in pairs if other is not None]
    found = {name: statistics.median(one[name] for one in ours) for name in QUANTITIES}
    found["scheduling"] = ours[0]["scheduling"]
    if not both:
        return found | {"cyclictest": None, "p99_ratio": None}
    beside = {name: statistics.median(other[name] for _, other in both) for name in QUANTITIES}
    ratio = statistics.median(a["p99"] / max(1.0, b["p99"]) for a, b in both)
    return found | {"cyclictest": beside, "p99_ratio": ratio}


def _lacking(cases):
    """What there was no cyclictest or no real-time priority for, a sentence each."""
    if any(case["cyclictest"] is None for case in cases):
        yield cyclictest.why_missing()
    yield from sorted({case["scheduling"] for case in cases if "no SCHED_FIFO" in case["scheduling"]})


def table(cases: list[dict]) -> str:
    """The lateness as a table of Markdown."""
    figures = ("p50", "p99", "p99.9", "max us", "missed")
    heads = ("rate Hz", "real-time", "load", *figures, *(f"cyclictest {figures[0]}", *figures[1:]), "p99 ratio")
    return markdown(heads, [[*_row(case), *_numbers(case["cyclictest"]), case["p99_ratio"]] for case in cases])


def _row(case):
    return [case["rate"], case["realtime"], case["load"], *_numbers(case)]


def _numbers(one):
    if one is None:
        return [None] * 5
    return [*(one[name] for name in ("p50", "p99", "p999", "max")), f"{one['missed']:g} of {one['ticks']:g}"]
