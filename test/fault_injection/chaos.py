# SPDX-License-Identifier: Apache-2.0
"""The running demo loses nodes, processor time and peace on its network; what was felt, as one JSON object.

`python test/fault_injection/chaos.py --help`; docs/theory/safety.md says what the figures are.
"""

import json
import os
import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

sys.path.append(str(Path(__file__).resolve().parents[1]))  # of this package

from haptic_display.cli.main import ending_in_a_sentence
from haptic_display.run.domain import isolated_domain
from haptic_display.run.processes import NodeDiedError, interruptible

STEP, ENERGY, RECOVERED = 0.5, 0.005, 3.0  # [N/ms], [J] of the default exchange.budget, [s]
SHORT = ("kill -9 driver", "SIGSTOP simulation", "e-stop")
_EVENT = "Only events with this in their name; may be repeated."
_SOAK = "Let the demo run undisturbed for the minutes, and watch memory, threads and descriptors of each node."


class Row(NamedTuple):
    """An event, how often it ran, the worst of its figures, and what of them lies beyond its bound."""

    name: str
    runs: int
    worst: object
    wrong: tuple[str, ...]


def chaos(
    minutes: Annotated[float | None, typer.Option(min=0.1, help="Go on at random; without it each event once.")] = None,
    event: Annotated[list[str] | None, typer.Option(help=_EVENT)] = None,
    short: Annotated[bool, typer.Option("--short", help=f"Only {', '.join(SHORT)}.")] = False,
    soak: Annotated[bool, typer.Option("--soak", help=_SOAK)] = False,
) -> None:
    """Take the running demo apart while a wall is pressed. Exit code 0 if every figure kept its bound."""
    from fault_injection.soak import soak as watched

    try:
        with interruptible():
            found = watched(minutes or 30.0, _programs) if soak else _chaos(minutes, _chosen(event, short))
    except KeyboardInterrupt:
        print("chaos: interrupted; all nodes have ended", file=sys.stderr, flush=True)
        os._exit(130)
    except NodeDiedError as error:
        raise ValueError(str(error)) from error
    print(json.dumps(found))
    raise typer.Exit(0 if found["ok"] else 1)


def _chosen(wanted, short):
    from fault_injection.chaos_events import EVENTS

    wanted = SHORT if short else wanted
    chosen = [each for each in EVENTS if not wanted or any(name in each.name for name in wanted)]
    if not chosen:
        raise ValueError(f"no event has {wanted[0]!r} in its name; there are {', '.join(e.name for e in EVENTS)}")
    return chosen


def _programs(folder: Path, rate: float = 1000.0):
    from haptic_device.config.files import find
    from haptic_display.run.system import Order, programs_of

    hand = {"motion.name": "follow", "motion.start": (0.03, 0.0, 0.0), "publish.rate": rate}
    point = find("", "demo").absolute()
    return programs_of(Order("wall", None, folder, None, None, point, given={"haptic_loopback": hand}))


def _chaos(minutes, events) -> dict:
    from fault_injection.fault_injector import FaultInjector

    with tempfile.TemporaryDirectory(prefix="haptic_chaos_") as name:
        folder = Path(name)
        with isolated_domain(folder / "log") as domain:
            injector = FaultInjector(_programs(folder), folder, domain)
            with injector:
                injector.begin()
                results = _play(injector, events, minutes)
                tracebacks = injector.tracebacks()
            left = injector.left_over()
    return _found([_row(event, results[event.name]) for event in events if results[event.name]], tracebacks, left)


def _play(injector, events, minutes) -> dict:
    """Each event once, and then at random until the time is over: {name: figures}."""
    results = {event.name: [] for event in events}
    end, waiting = time.monotonic() + 60.0 * (minutes or 0.0), list(events)
    while waiting or time.monotonic() < end:
        event = waiting.pop(0) if waiting else random.choice(events)
        injector.begin()
        results[event.name].append(event.run(injector))
        print(f"chaos: {event.name}: {_said(results[event.name][-1])}", file=sys.stderr, flush=True)
    return results


def _said(figures):
    parts = [f"{name} {value:.3g}" for name, value in figures._asdict().items() if isinstance(value, float)]
    return ", ".join([*parts, *figures.faults, *([figures.note] if figures.note else [])])


def _row(event, several) -> Row:
    from fault_injection.chaos_figures import worst

    found = worst(several)
    bounds = {"step": STEP, "energy": ENERGY, "safe": event.safe, "recovered": RECOVERED}
    wrong = [
        name
        for name, most in bounds.items()
        if most is not None and getattr(found, name) is not None and getattr(found, name) > most
    ]
    wrong += [name for name in found.faults if name not in event.faults] + list(found.wrong)
    wrong += ["safe"] if event.safe is not None and found.safe is None else []
    return Row(event.name, len(several), found, tuple(wrong))


def _found(rows, tracebacks, left) -> dict:
    events = [{"event": row.name, "runs": row.runs, **row.worst._asdict(), "wrong": row.wrong} for row in rows]
    ok = not (tracebacks or left or any(row.wrong for row in rows))
    return {"ok": ok, "tracebacks": tracebacks, "left_over": left, "events": events}


if __name__ == "__main__":
    with ending_in_a_sentence("chaos"):
        typer.run(chaos)
