# SPDX-License-Identifier: Apache-2.0
"""How late the servo wakes, beside cyclictest."""

import csv
import json
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from bench.jobs import deaths_told
from bench.servo import cyclictest
from bench.servo.servo_figure import save
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
    out: Annotated[Path | None, typer.Option(help="Folder for servo.csv, servo_histogram.csv and servo.png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """Lateness of the servo with real-time priority and without, beside cyclictest."""
    with interruptible(), deaths_told():
        cases, samples = lateness(rate or servo_lateness.RATES, seconds, turns, demo_seconds)
    if out is not None:
        keep(cases, samples, out)
    for lack in _lacking(cases):
        typer.echo(f"bench: {lack}", err=True)
    typer.echo(json.dumps({"lateness": cases}) if as_json else table(cases))


def lateness(rates, seconds: float, turns: int, beside_demo: float = 0.0) -> tuple[list[dict], dict]:
    """One entry a rate, scheduling and load: medians over the turns [us]; and {case: all samples [us]}.

    A demo that comes to nothing, as one without real-time priority may on a busy machine, is said and left out.
    """
    cases, samples = [], {}
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
                for who, column in zip(("servo", "cyclictest"), zip(*pairs, strict=True), strict=True):
                    known = [one.sorted_us for one in column if one is not None]
                    if known:
                        samples[rate, realtime, beside, who] = np.concatenate(known)
    return cases, samples


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


def keep(cases: list[dict], samples: dict, out: Path) -> None:
    """Table, histograms with bins of a microsecond, and their picture."""
    out.mkdir(parents=True, exist_ok=True)
    with open(out / "servo.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["rate_hz", "realtime", "load", "who", *QUANTITIES])
        for case in cases:
            for who, one in (("servo", case), ("cyclictest", case["cyclictest"] or {})):
                writer.writerow([case["rate"], case["realtime"], case["load"], who, *map(one.get, QUANTITIES)])
    with open(out / "servo_histogram.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["rate_hz", "realtime", "load", "who", "late_us", "count"])
        for case, late in samples.items():
            bins, counts = np.unique(np.floor(late).astype(int), return_counts=True)
            writer.writerows([*case, int(at), int(count)] for at, count in zip(bins, counts, strict=True))
    save(samples, out / "servo.png")


def _lacking(cases):
    """What there was no cyclictest or no real-time priority for, a sentence each."""
    if any(case["cyclictest"] is None for case in cases):
        yield cyclictest.why_missing()
    yield from sorted({case["scheduling"] for case in cases if "no SCHED_FIFO" in case["scheduling"]})


def table(cases: list[dict]) -> str:
    """The lateness as a table of Markdown."""
    lines = [
        "| rate | real-time | load | p50 | p99 | p99.9 | max us | missed | cyclictest p50 | p99 | p99.9 | max us "
        "| missed | p99 ratio |",
        "|" + " --- |" * 14,
    ]
    for case in cases:
        ours, theirs = (_numbers(one) for one in (case, case["cyclictest"]))
        ratio = "–" if case["p99_ratio"] is None else f"{case['p99_ratio']:.2f}"
        lines.append(f"| {case['rate']:g} Hz | {case['realtime']} | {case['load']} | {ours} | {theirs} | {ratio} |")
    return "\n".join(lines)


def _numbers(one):
    if one is None:
        return " | ".join("–" * 5)
    numbers = " | ".join(f"{one[name]:.1f}" for name in ("p50", "p99", "p999", "max"))
    return f"{numbers} | {one['missed']:g} of {one['ticks']:g}"
