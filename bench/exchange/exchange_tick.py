# SPDX-License-Identifier: Apache-2.0
"""What the exchange methods add to a servo tick's own work: median of interleaved runs of 20 000 ticks, three axes."""

import statistics
import time

import numba
import numpy as np

from haptic_device import controller_config
from haptic_device.control import enable_state, faults, records, servo
from haptic_device.description import load_device
from haptic_device.nodes.declared import NODES
from haptic_device.parameters import EXCHANGE_METHODS

TICKS, TURNS = 20_000, 15


@numba.njit
def run(settings, memory, row, ticks):
    """A handle that circles, and a new tool sample each fourth tick."""
    record = row[0]
    for k in range(ticks):
        phase = 0.001 * k
        record.sensors.latched = record.sensors.deadline = (k + 1) * 250_000.0
        record.sensors.command, record.sensors.device_status = enable_state.ENABLE, faults.FRESH
        record.sensors.counts[0], record.sensors.counts[1] = (
            np.round(4000.0 * np.cos(phase)),
            np.round(4000.0 * np.sin(phase)),
        )
        record.tool.age += 250e-6
        if k % 4 == 0:
            record.tool.session, record.tool.answered, record.tool.age = 1.0, k, 1e-3
            late = phase - 0.004
            record.tool.position[0], record.tool.position[1] = 0.02 * np.cos(late), 0.02 * np.sin(late)
            record.tool.velocity[0], record.tool.velocity[1] = -0.08 * np.sin(phase), 0.08 * np.cos(phase)
        servo.tick(settings[0], memory[0], record)


def timed(method):
    """Work of a tick [us]."""
    values = {parameter.name: parameter.default for parameter in NODES["haptic_driver"]} | {"exchange.method": method}
    settings = controller_config.settings_from(load_device("desktop"), values)
    memory, row = np.zeros(1, records.STATE), np.zeros(1, records.TICK)
    memory["enable"]["ramp"], memory["fade"]["factor"], memory["enable"]["state"] = 1.0, 1.0, enable_state.ENGAGED
    began = time.perf_counter()
    run(settings, memory, row, TICKS)
    return (time.perf_counter() - began) / TICKS * 1e6


def main() -> None:
    """What the exchange methods add to a servo tick's own work."""
    found = {method: [] for method in EXCHANGE_METHODS}
    for turn in range(TURNS + 1):
        for method in EXCHANGE_METHODS:
            work = timed(method)
            if turn > 0:  # the first compiles
                found[method].append(work)
    base = statistics.median(found["direct"])
    for method, times in found.items():
        extra = statistics.median(one - other for one, other in zip(times, found["direct"], strict=True))
        print(f"{method:7} {statistics.median(times):.3f} us a tick, {extra:+.3f} us on direct's {base:.3f}")
