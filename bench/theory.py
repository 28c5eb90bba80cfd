# SPDX-License-Identifier: Apache-2.0
"""Figures of the theory: condition (1) against closed forms, tables, the μ test, and where walls shake."""

import numpy as np

from adversary.switching import switched_cancellation_damping
from bench.reference.bisection import bisected
from bench.reference.boundary import CASES, boundary_stiffness
from bench.reference.closed_forms import (
    delayed_wall_damping,
    fractionally_delayed_spring_damping,
    lagged_wall_damping,
    wall_damping,
)
from haptic_device.theory.mu import mu_margin
from haptic_device.theory.passivity import least_damping
from haptic_device.theory.stability import largest_stable_stiffness
from haptic_device.theory.transfer import wall_transfer
from haptic_device.theory.zwidth import Operator, Setup

DRAWS, HALVINGS = 2000, 24


def main() -> None:
    """Condition (1) against closed forms, tables, the μ test, and where walls shake."""
    closed_forms()
    tables()
    stability()
    positive_damping()
    negative_damping()
    shaking()


def closed_forms():
    """Largest relative error of condition (1), found on a grid and refined, against each closed form."""
    rng = np.random.default_rng(1)
    period = 10.0 ** rng.uniform(-4.5, -2.0, (DRAWS, 1))
    stiffness = 10.0 ** rng.uniform(0.0, 5.0, (DRAWS, 1))
    damping = rng.choice([-1.0, 1.0], (DRAWS, 1)) * 10.0 ** rng.uniform(-3.0, 2.0, (DRAWS, 1))
    lag, samples = period * 10.0 ** rng.uniform(-1.0, 2.5, (DRAWS, 1)), rng.integers(0, 12, (DRAWS, 1))
    share = period / (period + lag)
    for name, wall, expected in (
        (
            "wall, B of either sign",
            lambda z: stiffness + damping * (z - 1.0) / (period * z),
            wall_damping(stiffness, damping, period),
        ),
        (
            "velocity lag",
            lambda z: stiffness + damping / period * share * (z - 1.0) / (z - 1.0 + share),
            lagged_wall_damping(stiffness, damping, period, lag),
        ),
        (
            "0 to 11 samples late",
            lambda z: (stiffness + damping * (z - 1.0) / (period * z)) * z**-samples,
            delayed_wall_damping(stiffness, damping, period, samples),
        ),
    ):
        error = np.max(np.abs(least_damping(wall, period).damping / np.squeeze(expected) - 1.0))
        print(f"condition (1) and its closed form, {name}: {error:.1e} relative over {DRAWS} draws")


def tables():
    """Damping needed in KT."""
    for samples in (0, 1, 2, 5):
        row = delayed_wall_damping(1.0, [0.0, 0.25, 0.5, 1.0, 2.0], 1.0, samples)
        print(f"N = {samples}, B/(KT) = 0, .25, .5, 1, 2:", *(f"{value:.4f}" for value in row))
    late = fractionally_delayed_spring_damping(1.0, 1.0, np.array([0.1, 0.25, 0.5, 0.75, 1.0]))
    print("delay .1, .25, .5, .75, 1 T, B = 0:", *(f"{value:.4f}" for value in late))
    switched = switched_cancellation_damping(1.0, 0.0, 1.0, np.array([0.0, 0.25, 0.5, 0.75, 0.9, 1.0]))
    print("cancelled outside 0, .25, .5, .75, .9, 1:", *(f"{value:.4f}" for value in switched))


def stability():
    """Largest stable stiffness [N/m] of m = 0.1 kg, b = 0.5 N s/m, T = 1 ms."""
    late = [largest_stable_stiffness(0.1, 0.5, 0.0, 1e-3, samples) for samples in (0, 1, 2)]
    damped = [largest_stable_stiffness(0.1, 0.5, damping, 1e-3) for damping in (0.25, 1.0, 5.0, 20.0)]
    print("stable up to, B = 0, N = 0, 1, 2:", *(f"{value:.2f}" for value in late))
    print("stable up to, B = .25, 1, 5, 20:", *(f"{value:.2f}" for value in damped))


def positive_damping():
    """Cases in which the μ test and (3) disagree, two thirds of them 0.1 % beside the bound."""
    rng, wrong = np.random.default_rng(7), 0
    for draw in range(DRAWS):
        period, stiffness = 10.0 ** rng.uniform(-4.0, -2.0), 10.0 ** rng.uniform(0.0, 5.0)
        damping = stiffness * period * 10.0 ** rng.uniform(-3.0, 1.0) * (draw % 10 > 0)
        share = [0.999, 1.001, 10.0 ** rng.uniform(-0.5, 0.5)][draw % 3]
        b = share * wall_damping(stiffness, damping, period)
        wrong += (mu_margin(wall_transfer(stiffness, damping, period), period, b) > 0.0) != (share > 1.0)
    print(f"mu and KT/2 + B, B >= 0: {wrong} disagreements in {DRAWS} cases")


def negative_damping():
    """Threshold of the μ test by bisection, K = T = 1."""
    for damping in (-0.05, -0.2, -0.3, -0.4):
        exact = 0.25 / (0.5 + damping)
        found = mu_threshold(damping)
        print(f"B = {damping:g} KT: mu asks for {found:.5f} KT, closed form {exact:.5f}, wall {0.5 - damping:.5f}")


def mu_threshold(damping):
    """Least b/(KT) by the μ test, for B/(KT)."""
    wall = wall_transfer(1.0, damping, 1.0)
    return bisected(lambda b: mu_margin(wall, 1.0, b) > 0.0, 0.1, 10.0, HALVINGS)


def shaking():
    """Where a wall begins to shake in lock-step under a constant push, against the eigenvalues [N/m]."""
    for mass, physical_damping, damping, period, delay in CASES:
        setup = Setup(mass, physical_damping, period, delay_samples=delay, seconds=10.0)
        exact = largest_stable_stiffness(mass, physical_damping, damping, period, delay)
        found = boundary_stiffness(setup, (Operator(pressed=True),), damping, 1.5 * exact)
        print(
            f"m {mass:g} kg, b {physical_damping:g}, B {damping:g} N s/m, T {period * 1e3:g} ms, delay {delay:g} T: "
            f"lock-step {found:.1f} N/m, eigenvalues {exact:.1f} N/m, {100.0 * (found / exact - 1.0):+.2f} %"
        )
