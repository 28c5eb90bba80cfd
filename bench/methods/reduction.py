# SPDX-License-Identifier: Apache-2.0
"""What the least model buys: the wall in closed form against the same scene in the general method.

Prints wall time per simulated second and the largest difference of the tool's path, for the scene's own motion.
"""

import time

import numpy as np

from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import GAINS, hand
from haptic_sim.scene.language import load

SECONDS = 2


def run(method, sub_step):
    """Path of the tool (x, y, theta, force) at 1 kHz and seconds of wall time per simulated second."""
    scene = load("wall")
    simulation, lead = Simulation(reduce_scene(scene, method), sub_step), hand(scene)
    samples = [HandleSample(k * 1_000_000, lead(k * 1e-3), (0.0, 0.0, 0.0), *GAINS) for k in range(1000 * SECONDS)]
    began = time.perf_counter()
    answers = [simulation.exchange(sample) for sample in samples]
    spent = (time.perf_counter() - began) / SECONDS
    return np.array([(*answer.position, answer.force_on_tool[0]) for answer in answers]), spent


def main() -> None:
    """The wall in closed form against the general method, one line for each sub-step."""
    print("sub-step  closed form  general   ratio  difference of path, force")
    for sub_step in (0.25e-3, 0.1e-3, 0.025e-3):
        (reduced, fast), (whole, slow) = (
            min((run(method, sub_step) for _ in range(3)), key=lambda found: found[1])
            for method in ("closed_form", "partitioned")
        )
        path, force = np.abs(reduced - whole)[:, :3].max(), np.abs(reduced - whole)[:, 3].max()
        print(
            f"{sub_step * 1e3:5.3f} ms {fast * 1e3:8.2f} ms/s {slow * 1e3:7.2f} ms/s {slow / fast:5.1f}  "
            f"{path * 1e6:.2f} um, {force:.3f} N"
        )
