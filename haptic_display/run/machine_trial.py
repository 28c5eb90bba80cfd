# SPDX-License-Identifier: Apache-2.0
"""What this machine can hold: its scheduling, the servo's lateness, the cost of an exchange, and rates to choose."""

import numpy as np

from haptic_device.realtime import machine
from haptic_device.realtime.servo_thread import PRIORITY
from haptic_display.run.lateness import RATES, alone
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.rollout import Exchanged, hand, rollout
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

EXCHANGES = (500, 1000, 2000)  # [Hz]
SHARE = 0.5  # of a period, in which force or answer must be there


def examine(seconds: float) -> dict:
    """Checks of the machine, lateness of the servo at its rates, cost of an exchange, and the rates to choose."""
    checks = [check._asdict() for check in machine.checks(PRIORITY)]
    trials = {}
    for rate in RATES:
        late, rows = alone(rate, seconds)
        trials[rate] = late.figures() | {"compute": float(rows["compute"][rows["compute"].argsort()[-10]]) * 1e6}
    exchange, servo_rate = _exchange_us(), fastest(trials)
    chosen = {"servo.rate": servo_rate, "exchange.rate": exchange_rate(servo_rate, exchange, trials, machine.cores())}
    return {"checks": checks, "servo": trials, "exchange_us_p99": exchange, "choose": chosen}


def fastest(trials: dict) -> int:
    """The largest rate at which force is written within half a period but for one tick in a thousand, else the least.

    A missed tick is one of these: it writes nothing. Beyond half a period the damping that delay costs is no longer
    what theory says (docs/theory/passivity.md).
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
    lead, path = hand(load(scene)), np.zeros((2 * count, 6))
    path[:, :3] = [lead(k * 1e-3) for k in range(2 * count)]
    spent = rollout(Exchanged(Simulation(reduce_scene(load(scene))), path[0]), path).spent
    return 1e6 * float(np.percentile(spent[count:], 99))
