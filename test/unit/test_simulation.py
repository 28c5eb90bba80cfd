# SPDX-License-Identifier: Apache-2.0
"""Exchanges: time in whole sub-steps, energy at the tool port, and the peg that goes into its hole."""

import hashlib
import subprocess
import sys

import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st

from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

MS = 1_000_000
STILL = (0.0, 0.0, 0.0)
GAINS = (2000.0, 2.0, 2.0, 0.002)


def sample(time_ns, position, velocity=STILL, gains=GAINS):
    return HandleSample(time_ns, position, velocity, *gains)


def least_jerk(start, target, duration, time):
    """Position and velocity of the smooth way from start to target; stays there afterwards."""
    s = min(time / duration, 1.0)
    share, rate = s**3 * (10 - 15 * s + 6 * s * s), 30 * s * s * (1 - s) ** 2 / duration
    return (
        tuple(a + (b - a) * share for a, b in zip(start, target, strict=True)),
        tuple((b - a) * rate for a, b in zip(start, target, strict=True)),
    )


def insert(simulation, seconds=5.0, gains=GAINS, **motion):
    """The scene's motion with the handle led exactly; the tool samples, one per exchange."""
    motion = {**simulation.scene.motion, **motion}
    way = tuple(motion["start"]), tuple(motion["target"]), motion["duration"]
    return [
        simulation.exchange(sample(time, *least_jerk(*way, time * 1e-9), gains))
        for time in range(0, int(seconds * 1e9), MS)
    ]


@pytest.fixture(scope="module")
def inserted():
    simulation = Simulation(reduce_scene(load("peg_in_hole")))
    return simulation, insert(simulation)


def test_the_peg_goes_to_the_bottom_of_its_hole(inserted):
    simulation, _ = inserted
    assert simulation.measure()["insertion_fraction"] == pytest.approx(1.0, abs=1e-3)


def test_pressed_on_the_bottom_the_peg_carries_stiffness_times_stretch_without_chatter(inserted):
    _, tools = inserted
    end = tools[-500:]
    assert all(tool.contact for tool in end)
    assert [tool.force_on_tool[1] for tool in end] == pytest.approx([-2000.0 * 0.005] * 500, rel=1e-3)
    assert max(abs(speed) for tool in end for speed in tool.velocity) < 1e-9


def test_under_ten_newtons_nothing_sinks_in_by_more_than_a_tenth_of_a_millimetre(inserted):
    simulation, _ = inserted
    assert simulation.counters.max_contact_force > 9.9
    assert 0.0 < simulation.counters.max_penetration <= 1e-5


@pytest.mark.parametrize("period_ns", [900_001, MS, 1_300_007])
def test_time_advances_by_whole_sub_steps_and_none_is_lost(period_ns):
    simulation = Simulation(reduce_scene(load("free_space")))
    for k in range(1000):
        simulation.exchange(sample(17 + k * period_ns, STILL))
    assert simulation.counters.sub_steps == 999 * period_ns // simulation.sub_step_ns


def test_a_sample_shorter_than_a_sub_step_after_the_last_advances_nothing():
    simulation = Simulation(reduce_scene(load("free_space")))
    simulation.exchange(sample(0, STILL))
    before = simulation.exchange(sample(MS, (0.001, 0.0, 0.0)))
    assert simulation.exchange(sample(MS + 249_999, (0.5, 0.0, 0.0))) == before
    assert simulation.exchange(sample(MS + 250_000, (0.5, 0.0, 0.0))).force_on_tool[0] > 100.0


@pytest.mark.parametrize(("gap", "sub_steps", "rejoined"), [(20 * MS, 80, 0), (20 * MS + 1, 0, 1), (-1, 0, 1)])
def test_the_world_catches_up_to_the_limit_and_beyond_it_waits(gap, sub_steps, rejoined):
    simulation = Simulation(reduce_scene(load("free_space")), max_catch_up=0.02)
    start = simulation.exchange(sample(MS, STILL)).position
    tool = simulation.exchange(sample(MS + gap, (0.01, 0.0, 0.0)))
    assert (simulation.counters.sub_steps, simulation.counters.rejoined) == (sub_steps, rejoined)
    assert (tool.position == start) == (sub_steps == 0)


def test_a_new_session_starts_a_new_time_base():
    simulation = Simulation(reduce_scene(load("free_space")))
    simulation.exchange(sample(5 * MS, STILL))
    simulation.rejoin()
    simulation.exchange(sample(9 * MS, STILL))
    assert (simulation.counters.sub_steps, simulation.counters.rejoined) == (0, 0)


RUN = """
import sys
sys.path[:0] = {path!r}
import test_simulation as t
print(t.digest())
"""


def digest():
    """Fingerprint of every bit of a short insertion."""
    tools = insert(Simulation(reduce_scene(load("peg_in_hole"))), 0.6, duration=0.5)
    return hashlib.sha256(repr(tools).encode()).hexdigest()


def test_the_same_samples_give_the_same_bits_in_another_process():
    program = RUN.format(path=sys.path)
    other = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert other.stdout.strip() == digest()


@pytest.mark.parametrize(("sub_step", "max_catch_up"), [(0.0, 0.02), (-1e-4, 0.02), (0.03, 0.02)])
def test_a_sub_step_of_nothing_or_beyond_the_catch_up_is_refused(sub_step, max_catch_up):
    with pytest.raises(ValueError, match=f"sub_step is {sub_step} s.*max_catch_up"):
        Simulation(reduce_scene(load("free_space")), sub_step, max_catch_up)


def test_energy_supplied_is_the_sum_of_force_times_way():
    simulation = Simulation(reduce_scene(load("free_space")), sub_step=1e-3)
    tools = insert(simulation, 0.5, start=[0, 0, 0], target=[0.05, -0.02, 0.5], duration=0.4)
    work = sum(
        force * (after - before)
        for past, tool in zip(tools, tools[1:], strict=False)
        for force, before, after in zip(tool.force_on_tool, past.position, tool.position, strict=True)
    )
    assert tools[-1].energy == pytest.approx(work, rel=1e-9)


@few(10)
@given(st.lists(st.tuples(*[st.floats(-reach, reach) for reach in (5e-3, 5e-3, 0.2)]), min_size=5, max_size=40))
def test_whatever_the_handle_does_a_free_tool_never_returns_more_than_it_was_given(handles):
    simulation = Simulation(reduce_scene(load("free_space")))
    for k, handle in enumerate(handles):
        simulation.exchange(sample(k * MS, handle))
        assert simulation.ledger.balance.dissipated >= -1e-12
