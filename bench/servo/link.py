# SPDX-License-Identifier: Apache-2.0
"""When the sample of a device on a line is in the servo's hand, beside a bare pair in C; how well its clock is known.

Ours is the reference device, the bridge's loop, and a page read as the servo reads it.
"""

import itertools
import json
import statistics
import sys
import time
from typing import Annotated

import numpy as np
import typer

from bench.jobs import markdown, medians
from bench.servo.link_rig import Pair, Rig

TRANSPORTS = "udp", "pty"
RATES = (1000.0, 4000.0)  # [Hz]
PPM, STEP_US, STEP_AT = 30.0, 200.0, 3.0  # of the device's clock: skew, its step [µs], when [s]
SETTLED, LATER = 2.0, 6.0  # [s] since the device began, between which its clock is looked at
LOOK, APART, NEAR = 0.002, 0.02, 10.0  # [s] between looks, and left out around the step; [µs] that is near enough
HELD = 0.5  # [s] for which the error has to stay below that
QUANTITIES = "p50", "p99", "late"

_RATE = "Servo rate [Hz]; may be repeated [1000 4000]."
_TURNS = "Turns, ours and the pair one after the other; medians count."


def main(
    rate: Annotated[list[float] | None, typer.Option(help=_RATE, min=500.0, max=10000.0)] = None,
    seconds: Annotated[float, typer.Option(help="Length of a measurement.", min=0.2, max=60.0)] = 2.0,
    turns: Annotated[int, typer.Option(help=_TURNS, min=1, max=100)] = 5,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the tables.")] = False,
) -> None:
    """Sample in hand after its deadline over UDP and a pseudo-terminal, beside a bare pair; the device's clock."""
    found = {"waits": waits(rate or RATES, seconds, turns), "clock": [clock(name) for name in TRANSPORTS]}
    typer.echo(json.dumps(found) if as_json else table(found))


def waits(rates, seconds: float, turns: int) -> list[dict]:
    """One entry a transport and rate: medians over the turns of both [us], shares of late ones, and the ratios.

    Raises ValueError, one sentence, without a C compiler or if no device answers.
    """
    found = []
    with Pair() as pair:
        for transport in TRANSPORTS:
            for rate in rates:
                print(f"{transport}, {rate:g} Hz", file=sys.stderr, flush=True)
                count = round(rate * seconds)
                both = [(_ours(transport, rate, count), pair.waits(transport, rate, count)) for _ in range(turns)]
                found.append({"transport": transport, "rate": rate, **of_turns(both)})
    return found


def _ours(transport, rate, count):
    with Rig(transport) as rig:
        return rig.waits(rate, count)


def of_turns(both) -> dict:
    """Of (ours, pair's) waits [ns] in each turn: medians; a ratio is None where one of them had nothing in time."""
    ours, pair = ([_figures(one) for one in column] for column in zip(*both, strict=True))
    found = {"ours": medians(ours, QUANTITIES), "pair": medians(pair, QUANTITIES)}
    for name in ("p50", "p99"):
        ratios = [a[name] / b[name] for a, b in zip(ours, pair, strict=True) if a[name] and b[name]]
        found[f"{name}_ratio"] = statistics.median(ratios) if ratios else None
    return found


def _figures(waits):
    came = waits[waits >= 0] * 1e-3
    known = {name: float(np.percentile(came, at)) if came.size else None for name, at in (("p50", 50), ("p99", 99))}
    return known | {"late": float(np.mean(waits < 0))}


def clock(transport: str, until: float = LATER) -> dict:
    """Error of the estimated clock of a device whose clock runs fast and is stepped; see `of_looks`.

    until: [s] since the device began.
    """
    print(f"{transport}, clock", file=sys.stderr, flush=True)
    options = {"--clock-ppm": PPM, "--clock-step-us": STEP_US, "--clock-step-at": STEP_AT}
    with Rig(transport, *(str(word) for option in options.items() for word in option)) as rig, rig.driven(RATES[0]):
        looks = []
        while not looks or looks[-1][0] < until:
            time.sleep(LOOK)
            now, device, steps = rig.clock()
            since = now - rig.began
            step = STEP_US * 1e3 if since >= STEP_AT * 1e9 else 0.0
            looks.append((since * 1e-9, (device - now - step - since * PPM * 1e-6) * 1e-3, steps))
    return {"transport": transport, **of_looks(np.array(looks))}


def of_looks(looks: np.ndarray) -> dict:
    """Of rows time [s], error [us], steps found: p99 of the error, without a step or after it was found and made good.

    again: how long after the step the error is below NEAR for HELD [s]; None: it never is.
    """
    when, error, steps = looks.T
    error = np.abs(error)
    before = (when >= SETTLED) & (when < STEP_AT - APART)
    after = when >= STEP_AT + APART
    good = _near_again(when, (when >= STEP_AT) & (error >= NEAR))
    settled = before | (after & (when >= (np.inf if good is None else good)))
    return {
        "p50": float(np.percentile(error[settled], 50)),
        "p99": float(np.percentile(error[settled], 99)),
        "steps": int(steps[-1]),
        "again": None if good is None else float(good - STEP_AT),
    }


def _near_again(when, far):
    """The first time after a far look that is followed by no other for HELD; None: there is none."""
    ends = [*when[far], when[-1]]
    for last, following in itertools.pairwise(ends):
        if following - last >= HELD:
            return when[np.searchsorted(when, last, side="right")]
    return None


def table(found: dict) -> str:
    """Both tables of Markdown."""
    heads = ("line", "rate Hz", "p50 us", "p99 us", "late", "pair p50", "p99", "late", "p50 ratio", "p99 ratio")
    rows = [
        [
            *(one["transport"], one["rate"]),
            *(one[who][name] for who in ("ours", "pair") for name in QUANTITIES),
            *(one["p50_ratio"], one["p99_ratio"]),
        ]
        for one in found["waits"]
    ]
    names = ("transport", "p50", "p99", "steps", "again")
    clocks = [[one[name] for name in names] for one in found["clock"]]
    return "\n\n".join(
        (
            markdown(heads, rows),
            markdown(("line", "error p50 us", "error p99 us", "steps found", "known again after s"), clocks),
        )
    )
