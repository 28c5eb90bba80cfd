# SPDX-License-Identifier: Apache-2.0
"""What the impulse method costs beside Chipmunk itself: coupling, time-of-impact guard and readout, as a ratio.

Bare is the time within `space.step` less that of the coupling, which Chipmunk calls back from there.
"""

import statistics
import sys
import time

from haptic_sim.method import Coupling
from haptic_sim.method.impulse import Impulse
from haptic_sim.scene import load
from haptic_sim.trial import hand

SCENES = ("corner", "peg_in_hole", "push_block", "stack", "stack_20")
H = 0.25e-3


class _Clock:
    """Passes calls on and adds up their time [s]."""

    def __init__(self, call):
        self.call, self.total = call, 0.0

    def __call__(self, *arguments):
        began = time.perf_counter()
        try:
            return self.call(*arguments)
        finally:
            self.total += time.perf_counter() - began


def cost(name, seconds=1.5):
    """(µs a step, of that bare, coupling, guard) of a scene with its motion."""
    scene = load(name)
    method, lead = Impulse(scene, H), hand(scene)
    method.couple(Coupling(2000.0, 2.0, 2.0, 0.002))
    coupling, guard = _Clock(method._couple_tool), _Clock(method._guard.share)
    method._tool.velocity_func = coupling
    method._guard.share = guard
    solve = method._solve = _Clock(method._solve)
    total, count = 0.0, round(seconds / H)
    for k in range(count):
        here = lead(scene.motion["duration"] * 0.3 + k * H)
        began = time.perf_counter()
        method.step(here, (0.0, 0.0, 0.0))
        total += time.perf_counter() - began
    return [1e6 * spent / count for spent in (total, solve.total - coupling.total, coupling.total, guard.total)]


def main():
    """One line a scene, medians of five runs."""
    print(f"{'scene':12} {'step us':>8} {'bare':>7} {'coupling':>9} {'guard':>7} {'ratio':>6}")
    for name in sys.argv[1:] or SCENES:
        step, bare, coupling, guard = (statistics.median(times) for times in zip(*(cost(name) for _ in range(5)),
                                                                                 strict=True))
        print(f"{name:12} {step:8.1f} {bare:7.1f} {coupling:9.1f} {guard:7.1f} {step / bare:6.2f}", flush=True)


if __name__ == "__main__":
    main()
