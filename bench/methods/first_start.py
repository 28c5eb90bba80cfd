# SPDX-License-Identifier: Apache-2.0
"""Prints what the first step of each compiled method costs [s]: with an empty cache of kernels, and from the cache."""

import os
import subprocess
import sys
import tempfile

from haptic_sim.method_registry import METHODS as ALL

METHODS = tuple(name for name in ALL if name != "impulse")  # which compiles nothing
FIRST_STEP = """
import sys, time
from haptic_sim.reduction import reduce_scene
from haptic_sim.protocol import held
from haptic_sim.method_registry import make
from haptic_sim.scene.language import load
began = time.perf_counter()
scene = reduce_scene(load("wall" if sys.argv[1] == "closed_form" else "stack"))
make(sys.argv[1], scene, 1e-3).step(held((0.0, 0.0, 0.0)), 1)
print(time.perf_counter() - began)
"""


def seconds(method, cache):
    """Time of the first step in a process of its own [s]."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST_STEP, method],
        env={**os.environ, "XDG_CACHE_HOME": cache},
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


def main() -> None:
    """What the first step of each compiled method costs, one line a method."""
    print(f"{'method':18} {'empty cache':>12} {'warm':>6}")
    for method in METHODS:
        with tempfile.TemporaryDirectory() as cache:
            print(f"{method:18} {seconds(method, cache):12.1f} {seconds(method, cache):6.2f}", flush=True)
