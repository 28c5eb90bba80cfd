# SPDX-License-Identifier: Apache-2.0
"""Takes all processors away at times, as a host does that other guests share: what runs beside it must bear that.

`python bench/stolen_time.py HOLE EVERY`, in seconds, runs until interrupted: each processor is held for HOLE at the
highest real-time priority, at intervals drawn around EVERY. Needs the right to real-time priority. Run the live tests
beside it: none may fail.
"""

import multiprocessing
import os
import random
import sys
import time


def hold(processor, begin, hole):
    """Holds one processor from CLOCK_MONOTONIC `begin` [s] on, for `hole` [s]."""
    time.sleep(max(0.0, begin - time.monotonic()))
    while time.monotonic() < begin + hole:
        pass


def worker(processor, hole, every, seed):
    """One processor's part; the same seed in all gives the same moments."""
    os.sched_setaffinity(0, [processor])
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
    drawn, begin = random.Random(seed), seed
    while True:
        begin += hole + drawn.expovariate(1.0 / every)
        hold(processor, begin, hole)


def main():
    hole, every = float(sys.argv[1]), float(sys.argv[2])
    ways = multiprocessing.get_context("spawn")
    begin = time.monotonic() + 1.0
    workers = [
        ways.Process(target=worker, args=(processor, hole, every, begin), daemon=True)
        for processor in sorted(os.sched_getaffinity(0))
    ]
    for one in workers:
        one.start()
    try:
        for one in workers:
            one.join()
    except KeyboardInterrupt:
        print(f"took {hole:g} s about every {hole + every:g} s for {time.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    main()
