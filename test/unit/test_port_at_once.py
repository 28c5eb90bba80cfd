# SPDX-License-Identifier: Apache-2.0
"""An exchange made at once behind a port: only where no tool, whatever it does, can take more than the tank holds."""

import itertools

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from haptic_device.control import tool_side_tank
from haptic_sim.exchange import BUDGET, Limits
from haptic_sim.exchange.port import PspmPort, port_of
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.lockstep.rollout import GAINS
from haptic_sim.protocol import STILL, Coupling, StepResult, along
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

H, MS = 0.25e-3, 1_000_000
WIDE = Limits(1e6, 1e6, 1e12)


def sample(number, place, rate, gains, energy, limit=0.0):
    """The handle sample of one axis; limit: on the hand [N], 0 where it is not told."""
    return HandleSample(number * MS, (place, 0.0, 0.0), (rate, 0.0, 0.0), *gains, energy, (limit, 0.0, 0.0))


class Willing:
    """A tool of one axis that moves by `moves`, of which the world lets it go the shares `made`; it notes its pulls."""

    def __init__(self, inner, moves=(), made=()):
        self.inner, self.asked, self.pulls, self.gains = inner, [], [], Coupling()
        self.position = self.force_on_tool = STILL
        self._moves, self._made, self._tool, self.given = iter(moves), iter(made), 0.0, 0.0

    def step(self, target, n):
        """As a world by backward difference whose moves may be cut short: the way that is lost is paid for."""
        self.asked.append(n)
        h, steps, supplied = H / self.inner, n * self.inner, 0.0
        for j in range(1, steps + 1):
            row = target[0] + j / steps * (target[1] - target[0])
            velocity = next(self._moves, 0.0) / h
            aim = row[0] - self._tool - h * velocity
            force = self.gains.stiffness * aim + self.gains.damping * (row[3] - velocity)
            way, share = h * velocity, next(self._made, 1.0)
            supplied += force * way if force * way > 0.0 else share * force * way
            self._tool += share * way
            self.pulls.append(force)
        self.given += supplied
        self.position, self.force_on_tool = (self._tool, 0.0, 0.0), (force, 0.0, 0.0)
        return StepResult(supplied)


def largest(pulls, shares, gains, h):
    """The most [J] that any moves take of these pulls at rest: ¼ aᵀ Q⁻¹ a; inf if they can take what they like."""
    count = len(pulls)
    square = gains.stiffness * np.tril(np.tile(shares, (count, 1)), -1)
    square += (gains.stiffness + gains.damping / h) * np.eye(count)
    square = 0.5 * (square + square.T)
    return 0.25 * pulls @ np.linalg.solve(square, pulls) if np.linalg.eigvalsh(square)[0] > 0.0 else np.inf


@few(60)
@given(
    pulls=st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=6),
    damping=st.floats(0.0, 4.0),
    stiffness=st.sampled_from([0.0, 500.0, 2000.0, 20000.0]),
)
def test_no_tool_takes_more_than_the_bound_whichever_of_its_moves_the_world_cuts(pulls, damping, stiffness):
    """Energy is convex in the shares of the moves that are made, so the worst are whole or none."""
    gains, count, h = Coupling(stiffness, damping), len(pulls), H / 2
    held = stiffness * (1.0 - count / 4.0) + damping / h
    if held > 1e-3 * (stiffness + damping / h) and held > 0.0:
        bound = count * np.max(np.square(pulls)) / (4.0 * held)
        for shares in itertools.product((0.0, 1.0), repeat=count):
            assert largest(np.array(pulls), np.array(shares), gains, h) <= bound * (1.0 + 1e-9)


GENES = st.tuples(st.floats(-4e-3, 4e-3), st.floats(-0.5, 0.5), st.sampled_from([0.0, 1e-3, 0.02]))


@few(60)
@given(
    way=st.lists(GENES, min_size=2, max_size=12),
    moves=st.lists(st.floats(-2e-3, 2e-3), min_size=96, max_size=96),
    made=st.lists(st.sampled_from([0.0, 0.5, 1.0]), min_size=96, max_size=96),
    gains=st.sampled_from([(2000.0, 2.0), (2000.0, 0.0), (500.0, 4.0), (0.0, 2.0)]),
    limits=st.sampled_from([WIDE, Limits()]),
    told=st.lists(st.sampled_from([0.0, 0.5, 3.0, 15.0]), min_size=12, max_size=12),
    budget=st.sampled_from([0.01, BUDGET]),
)
def test_whatever_the_tool_does_over_whole_exchanges_the_tank_is_not_overdrawn(
    way, moves, made, gains, limits, told, budget
):
    """Nor with limits that are told anew with every sample: what is granted is never more than the budget."""
    port, world, shipped = PspmPort(budget, limits), Willing(2, moves, made), 0.0
    before = along((STILL, STILL))
    for number, (place, rate, energy) in enumerate(way):
        shipped += energy
        told_now = sample(number, place, rate, (*gains, 0.0, 0.0), shipped, told[number])
        world.gains = port.receive(told_now, H, world.inner)
        after = along(((place, 0.0, 0.0), (rate, 0.0, 0.0)))
        port.step(world, np.concatenate([before, after]), 4)
        before = after
        assert port.tank >= -1e-12 and port.granted <= budget
        # what was shipped after the first sample, less all that the tool was given
        assert port.tank == pytest.approx(port.granted + shipped - way[0][2] - world.given, abs=1e-12)


def asked_of(way, gains=(2000.0, 2.0), limits=WIDE, budget=BUDGET):
    """How many sub-steps a world is asked for at a time, in exchanges of four."""
    port, world, before = PspmPort(budget, limits), Willing(2), along((STILL, STILL))
    for number, (place, rate) in enumerate(way):
        world.gains = port.receive(sample(number, place, rate, (*gains, 0.0, 0.0), 0.0), H, world.inner)
        after = along(((place, 0.0, 0.0), (rate, 0.0, 0.0)))
        port.step(world, np.concatenate([before, after]), 4)
        before = after
    return world.asked, world.pulls


REST = (0.0, 0.0)


def test_an_exchange_is_made_at_once_from_the_second_on_which_has_a_pull_to_go_on_from():
    assert asked_of([REST] * 3)[0] == [1, 1, 1, 1, 4, 4]


def test_it_goes_sub_step_by_sub_step_where_the_tank_is_short_and_not_where_it_just_covers_it():
    """8 steps of 1/8 ms at K = 2 N/mm, B = 2 N s/m and 2 N: 8 · 4/4(16 - 2)k, and 2 N let go of at once."""
    worst = 8 * 2.0**2 / (4.0 * (2000.0 * (1 - 8 / 4) + 2.0 / (H / 2)))
    worst += tool_side_tank.worst(1000.0, 2.0, H) * 2.0**2
    for budget, asked in ((1.001 * worst, [4]), (0.999 * worst, [1] * 4)):
        assert asked_of([REST, (1e-3, 0.0)], budget=budget)[0][4:] == asked


@pytest.mark.parametrize(("gains", "asked"), [((2000.0, 2.0), [4]), ((2000.0, 0.0), [1] * 4), ((0.0, 0.0), [4])])
def test_it_does_so_with_a_spring_too_stiff_for_its_damping_but_not_where_nothing_couples(gains, asked):
    assert asked_of([REST, (1e-6, 0.0)], gains)[0][4:] == asked


@pytest.mark.parametrize(
    ("stretch", "limits"),
    [
        (tool_side_tank.AT_ONCE * 1.0 / 2000.0, Limits(1.0, 1.0, 1e9)),
        (2000.0 * 4 * H / 2000.0, Limits(20.0, 1.0, 2000.0)),
    ],
    ids=["limit", "slew"],
)
def test_it_does_so_where_the_pull_comes_near_its_limit_or_changes_faster_than_the_slew(stretch, limits):
    for share, asked in (0.99, [4]), (1.01, [1] * 4):
        assert asked_of([REST, (share * stretch, 0.0)], limits=limits)[0][4:] == asked


def test_the_pull_goes_on_from_one_way_of_making_an_exchange_to_the_other_no_faster_than_the_slew():
    random, limits, both = np.random.default_rng(1), Limits(), set()
    for _ in range(40):
        way = np.cumsum(random.normal(size=(12, 2)) * (10.0 ** random.uniform(-4.5, -2.5), 0.01), axis=0)
        asked, pulls = asked_of(way.tolist(), limits=limits)
        both |= set(asked)
        ends = np.array([0.0, *pulls[1::2]])  # of sub-steps
        assert np.abs(np.diff(ends)).max() <= (1.0 + tool_side_tank.DAMPER_SLEW) * limits.slew * H * (1.0 + 1e-9)
    assert both == {1, 4}


@pytest.mark.parametrize("method", ["impulse", "partitioned"])
def test_where_energy_is_there_the_tool_goes_as_with_a_port_that_minds_none(method):
    minded, free = (Simulation(reduce_scene(load("peg_in_hole"), method), port=port_of(p)) for p in ("pspm", "direct"))
    x, y, angle = free.scene.tool.pose
    for number in range(150):
        gone = 1e-3 * max(0, number - 2)  # s; the first exchange, sub-step by sub-step, at rest
        place, rate = (x + 0.02 * gone**2, y - 0.2 * gone**2, angle), (0.04 * gone, -0.4 * gone, 0.0)
        told = HandleSample(number * MS, place, rate, *GAINS, 1e-3 * number)
        answers = [one.exchange(told) for one in (minded, free)]
        assert answers[0].position == pytest.approx(answers[1].position, abs=1e-12)
        assert answers[0].velocity == pytest.approx(answers[1].velocity, abs=1e-9)


@few(60)
@given(
    moves=st.lists(st.floats(-2e-3, 2e-3), min_size=160, max_size=160),
    made=st.lists(st.sampled_from([0.0, 1.0]), min_size=160, max_size=160),
    damping=st.sampled_from([0.25, 2.0]),
    inner=st.sampled_from([2, 5, 16, 20]),
)
def test_sub_step_by_sub_step_no_more_is_taken_either_however_many_steps_a_sub_step_has(moves, made, damping, inner):
    """Where the damping is enough for a bound: λ > 0."""
    if 2000.0 * (1.0 - inner / 4.0) + damping * inner / H > 0.0:
        port, world = PspmPort(1e-3, WIDE), Willing(inner, moves, made)
        for number in range(8):
            world.gains = port.receive(sample(number, 2e-3, 0.0, (2000.0, damping, 0.0, 0.0), 0.0), H, inner)
            port.step(world, along(((2e-3, 0.0, 0.0), STILL), ((2e-3, 0.0, 0.0), STILL)), 1)
            assert port.tank >= -1e-12
