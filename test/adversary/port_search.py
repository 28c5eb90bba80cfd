# SPDX-License-Identifier: Apache-2.0
"""Search for handle samples and a world by which a tool port supplies the tool with more energy than was shipped.

The world is the adversary's too: in every sub-step the tool moves by whatever a gene says, as contacts might have it,
and the coupling's force follows by backward difference, K (x_h − x⁺) + B (v_h − v⁺). One axis. A path is an array
(exchanges, 4 + sub-steps): handle's position and velocity, energy and wave shipped, then the tool's velocities.
"""

from typing import NamedTuple

import numpy as np

SUB_STEPS = 4
SCALE = np.array([5e-3, 0.5, 1e-3, 1e-2, *[0.3] * SUB_STEPS])


class Supplied(NamedTuple):
    """Most energy [J] that was supplied beyond what had been shipped, evaluations, and the path."""

    energy: float
    evaluations: int
    path: np.ndarray


def oversupply(port, sample, path, sub_step, inner=1):
    """Most energy supplied beyond what was shipped [J]. sample(number, position, velocity, effort, energy).

    inner: steps in which the world takes a sub-step, the tool's velocity the same in all.
    """
    tool, supplied, shipped, effort, first, most = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for number, (place, rate, energy, wave, *moves) in enumerate((path * SCALE).tolist()):
        shipped, effort = shipped + abs(energy), effort + wave
        first = shipped if number == 0 else first
        gains = port.receive(sample(number, place, rate, effort, shipped), sub_step, inner)
        for velocity in moves:
            (aim, _, _), (speed, _, _) = port.drive((place, 0.0, 0.0), (rate, 0.0, 0.0), (tool, 0.0, 0.0))
            before, made, mean = tool, 0.0, 0.0
            for _ in range(inner):
                tool += sub_step / inner * velocity
                force = gains.stiffness * (aim - tool) + gains.damping * (speed - velocity)
                made, mean = made + force * velocity * sub_step / inner, mean + force / inner
            port.book(made, (mean, 0.0, 0.0), (before, 0.0, 0.0), (tool, 0.0, 0.0))
            supplied += made
            most = max(most, supplied - (shipped - first))
        port.send((force, 0.0, 0.0), supplied)
    return most


def fastest(port_of, sample, evaluations, sub_step=0.25e-3, exchanges=12, seed=0):
    """Largest pull on a held tool [N], and the fastest change of it [N/ms], that any of so many random paths made."""
    random, pull, change = np.random.default_rng(seed), 0.0, 0.0
    for _ in range(evaluations):
        path = random.normal(size=(exchanges, len(SCALE))) * 10.0 ** random.uniform(-1.0, 1.0)
        pulls = np.array([0.0, *_pulls(port_of(), sample, path, sub_step)])
        pull, change = max(pull, np.abs(pulls).max()), max(change, np.abs(np.diff(pulls)).max())
    return float(pull), float(change) / (sub_step * 1e3)


def _pulls(port, sample, path, sub_step):
    """Force on a tool that is held at 0 [N], sub-step by sub-step."""
    still, shipped, effort = (0.0, 0.0, 0.0), 0.0, 0.0
    for number, (place, rate, energy, wave, *moves) in enumerate((path * SCALE).tolist()):
        shipped, effort = shipped + abs(energy), effort + wave
        gains = port.receive(sample(number, place, rate, effort, shipped), sub_step)
        for _ in moves:
            (aim, _, _), (speed, _, _) = port.drive((place, 0.0, 0.0), (rate, 0.0, 0.0), still)
            force = gains.stiffness * aim + gains.damping * speed
            port.book(0.0, (force, 0.0, 0.0), still, still)
            yield force


def search(port_of, sample, sub_step=0.25e-3, exchanges=12, evaluations=500, seed=0, inner=1):
    """Evolution strategy with one parent and one child against ports made by port_of(). Returns Supplied."""
    random = np.random.default_rng(seed)
    best, score, size = np.zeros((exchanges, len(SCALE))), -np.inf, 0.5
    for _ in range(evaluations):
        child = np.clip(best + size * random.normal(size=best.shape) * (random.random(best.shape) < 0.2), -3.0, 3.0)
        value = oversupply(port_of(), sample, child, sub_step, inner)
        better = value > score
        size = min(2.0, max(0.02, size * (1.5 if better else 0.97)))
        best, score = (child, value) if better else (best, score)
    return Supplied(score, evaluations, best)
