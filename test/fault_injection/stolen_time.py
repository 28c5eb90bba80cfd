# SPDX-License-Identifier: Apache-2.0
"""Takes all processors away at times, as a host does that other guests share: what runs beside it must bear that.

`python test/fault_injection/stolen_time.py HOLE EVERY`, in seconds, runs until interrupted: each processor is held for
HOLE at the highest real-time priority, at intervals drawn around EVERY. Needs the right to real-time priority. Run the
live tests beside it: none may fail.
"""

import os
import random
import signal
import subprocess
import sys
import time

from haptic_device.process import ending_with_us


def hold(processor, hole, every, begin):
    """Holds one processor time after time; the same `begin` [s of CLOCK_MONOTONIC] in all gives the same moments."""
    os.sched_setaffinity(0, [processor])
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
    drawn = random.Random(begin)
    while True:
        begin += hole + drawn.expovariate(1.0 / every)
        time.sleep(max(0.0, begin - time.monotonic()))
        while time.monotonic() < begin + hole:
            pass


def main():
    hole, every = map(float, sys.argv[1:3])
    begin = time.monotonic() + 1.0
    signal.signal(signal.SIGINT, signal.default_int_handler)
    workers = [
        subprocess.Popen(ending_with_us([sys.executable, __file__, *map(str, (hole, every, processor, begin))]))
        for processor in sorted(os.sched_getaffinity(0))
    ]
    try:
        for worker in workers:
            worker.wait()
    except KeyboardInterrupt:
        print(f"took {hole:g} s about every {hole + every:g} s for {time.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    if len(sys.argv) > 3:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        hold(int(sys.argv[3]), *map(float, (*sys.argv[1:3], sys.argv[4])))
    else:
        main()
