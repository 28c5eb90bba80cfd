# SPDX-License-Identifier: Apache-2.0
"""Search for handle samples and a world by which a tool port supplies the tool with more energy than was shipped.

The world is the adversary's too: in every sub-step the tool moves by whatever a gene says, as contacts might have it,
and the coupling's force follows by backward difference, K (x_h − x⁺) + B (v_h − v⁺). One axis. A path is an array
(exchanges, 3 + sub-steps): handle's position and velocity, energy shipped, then the tool's velocities.
"""

from typing import NamedTuple

import numpy as np

from haptic_sim.protocol import STILL, Coupling, StepResult, held

SUB_STEPS = 4
SCALE = np.array([5e-3, 0.5, 1e-3, *[0.3] * SUB_STEPS])


class Puppet:
    """A world of one axis whose tool moves at `velocity` [m/s] whatever pulls: what of `World` a port asks for."""

    def __init__(self, sub_step, inner=1):
        self.inner, self._step, self.gains, self.velocity = inner, sub_step / inner, Coupling(), 0.0
        self.position = self.force_on_tool = STILL

    def step(self, target, n):
        assert n == 1  # a port that sees each sub-step, or a handle that is kept
        aim, _, _, speed, _, _ = target[-1].tolist()
        tool, made, mean = self.position[0], 0.0, 0.0
        for _ in range(self.inner):
            tool += self._step * self.velocity
            force = self.gains.stiffness * (aim - tool) + self.gains.damping * (speed - self.velocity)
            made, mean = made + force * self.velocity * self._step, mean + force / self.inner
        self.position, self.force_on_tool = (tool, 0.0, 0.0), (mean, 0.0, 0.0)
        return StepResult(made)


class Supplied(NamedTuple):
    """Most energy [J] that was supplied beyond what had been shipped, evaluations, and the path."""

    energy: float
    evaluations: int
    path: np.ndarray


def oversupply(port, sample, path, sub_step, inner=1, limits=(SUB_STEPS,)):
    """Most energy supplied beyond what was shipped [J]. sample(number, position, velocity, energy).

    inner: steps in which the world takes a sub-step, the tool's velocity the same in all; limits: most sub-steps that
    are made in the exchanges, in turns: the rest is left out.
    """
    world, supplied, shipped, first, most = Puppet(sub_step, inner), 0.0, 0.0, 0.0, 0.0
    for number, (place, rate, energy, *moves) in enumerate((path * SCALE).tolist()):
        shipped += abs(energy)
        first = shipped if number == 0 else first
        world.gains = port.receive(sample(number, place, rate, shipped), sub_step, inner)
        for world.velocity in moves[: limits[number % len(limits)]]:
            supplied += port.step(world, held((place, 0.0, 0.0), (rate, 0.0, 0.0)), 1).supplied
            most = max(most, supplied - (shipped - first))
        port.send(supplied)
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
    world, shipped = Puppet(sub_step), 0.0
    for number, (place, rate, energy, *moves) in enumerate((path * SCALE).tolist()):
        shipped += abs(energy)
        world.gains = port.receive(sample(number, place, rate, shipped), sub_step)
        for _ in moves:
            port.step(world, held((place, 0.0, 0.0), (rate, 0.0, 0.0)), 1)
            yield world.force_on_tool[0]


def search(port_of, sample, sub_step=0.25e-3, exchanges=12, evaluations=500, seed=0, **given):
    """Evolution strategy with one parent and one child against ports made by port_of(). Returns Supplied.

    given: of `oversupply`.
    """
    random = np.random.default_rng(seed)
    best, score, size = np.zeros((exchanges, len(SCALE))), -np.inf, 0.5
    for _ in range(evaluations):
        child = np.clip(best + size * random.normal(size=best.shape) * (random.random(best.shape) < 0.2), -3.0, 3.0)
        value = oversupply(port_of(), sample, child, sub_step, **given)
        better = value > score
        size = min(2.0, max(0.02, size * (1.5 if better else 0.97)))
        best, score = (child, value) if better else (best, score)
    return Supplied(score, evaluations, best)
