# SPDX-License-Identifier: Apache-2.0
"""Processor time of one exchange at 1 kHz, sub-steps and answer, of every scene with its default method [µs].

`python bench/realtime.py [scene ...]`; the whole suggested motion, at least 4 s of simulated time, as fast as it goes.
An exchange may take half a millisecond in all but one of a thousand. Time in which the machine does something else is
not counted: that is for `haptic check` and the live nodes' diagnostics.
"""

import gc
import sys
import time

from haptic_device.share import names
from haptic_sim.scene import load
from haptic_sim.simulation import HandleSample, Simulation
from haptic_sim.trial import EXCHANGE_NS, GAINS, hand

LIMIT = 500.0


def times(name):
    """(method, sorted times of all exchanges [µs])."""
    scene = load(name)
    world, lead = Simulation(scene), hand(scene)
    spent, last = [], lead(0.0)
    for k in range(int(max(scene.motion["duration"], 4.0) * 1e3)):
        here = lead(k * 1e-3)
        velocity = tuple((a - b) * 1e3 for a, b in zip(here, last, strict=True))
        sample = HandleSample(k * EXCHANGE_NS, here, velocity, *GAINS)
        began = time.thread_time_ns()
        world.exchange(sample)
        spent.append((time.thread_time_ns() - began) / 1e3)
        last = here
    return world.method_name, sorted(spent[2:])


def main():
    """One line a scene."""
    gc.disable()
    print(f"{'scene':20} {'method':12} {'p50':>7} {'p99':>7} {'p99.9':>7} {'worst':>8}")
    for name in sys.argv[1:] or names("scenes"):
        method, spent = times(name)
        middle, most, rare = (spent[int(share * (len(spent) - 1))] for share in (0.5, 0.99, 0.999))
        print(f"{name:20} {method:12} {middle:7.1f} {most:7.1f} {rare:7.1f} {spent[-1]:8.1f}"
              f"{'' if rare <= LIMIT else '  over'}", flush=True)


if __name__ == "__main__":
    main()
