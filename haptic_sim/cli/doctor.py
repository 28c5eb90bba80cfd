# SPDX-License-Identifier: Apache-2.0
"""`haptic doctor`: what this machine can hold, which rates to choose, and how to get more."""

import json
from typing import Annotated

import typer

EXCHANGES = (500, 1000, 2000)  # [Hz]
SHARE = 0.5  # of a period, in which force or answer must be there


def doctor(
    seconds: Annotated[float, typer.Option(min=0.2, max=60.0, help="Length of the trial at each servo rate.")] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """What this machine can hold: scheduling, cores, clock; servo and exchange rate to choose; how to get more."""
    found = examine(seconds)
    typer.echo(json.dumps(found)) if as_json else _show(found)


def examine(seconds: float) -> dict:
    """Checks of the machine, lateness of the servo at its rates, cost of an exchange, and the rates to choose."""
    from haptic_device.realtime import machine
    from haptic_device.realtime.servo_thread import PRIORITY
    from haptic_sim.cli.lateness import RATES, alone

    checks = [check._asdict() for check in machine.checks(PRIORITY)]
    trials = {}
    for rate in RATES:
        late, rows = alone(rate, seconds)
        trials[rate] = late.figures() | {"compute": float(rows["compute"][rows["compute"].argsort()[-10]]) * 1e6}
    exchange = _exchange_us()
    servo_rate = fastest(trials)
    return {
        "checks": checks,
        "servo": trials,
        "exchange_us_p99": exchange,
        "choose": {
            "servo.rate": servo_rate,
            "exchange.rate": exchange_rate(servo_rate, exchange, trials, machine.cores()),
        },
    }


def fastest(trials: dict) -> int:
    """The largest rate at which force is written within half a period but for one tick in a thousand, else the least.

    A missed tick is one of these: it writes nothing. Beyond half a period the damping that delay costs is no longer
    what theory says (docs/passivity.md).
    """
    good = [
        rate
        for rate, one in trials.items()
        if one["p999"] + one["compute"] <= SHARE * 1e6 / rate and one["missed"] <= 1e-3 * one["ticks"]
    ]
    return max(good, default=min(trials))


def exchange_rate(servo_rate: int, answer_us: float, trials: dict, cores: int) -> int:
    """The largest rate whose answers come within half a period, by a simulation on a core of its own."""
    late = 4.0 * trials[servo_rate]["p999"]  # driver, middleware, simulation and driver again are woken
    good = [
        rate
        for rate in EXCHANGES
        if rate <= servo_rate and answer_us + late <= SHARE * 1e6 / rate and (cores > 1 or rate == EXCHANGES[0])
    ]
    return max(good, default=EXCHANGES[0])


def _exchange_us(scene: str = "peg_in_hole", count: int = 1000) -> float:
    """p99 of an exchange's processor time [us] while a peg goes into a hole."""
    import numpy as np

    from haptic_sim.reduction import reduce_scene
    from haptic_sim.rollout import Exchanged, hand, rollout
    from haptic_sim.scene import load
    from haptic_sim.simulation import Simulation

    lead, path = hand(load(scene)), np.zeros((2 * count, 6))
    path[:, :3] = [lead(k * 1e-3) for k in range(2 * count)]
    spent = rollout(Exchanged(Simulation(reduce_scene(load(scene))), path[0]), path).spent
    return 1e6 * float(np.percentile(spent[count:], 99))


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
