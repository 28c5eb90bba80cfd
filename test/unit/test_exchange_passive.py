# SPDX-License-Identifier: Apache-2.0
"""Whatever samples come: the operator gets no more than the budget, the tool no more than what was shipped."""

import itertools

import numpy as np
import pytest
from examples import few
from exchange_systems import GAINS, credited, demo_system, one_axis
from hypothesis import example, given
from hypothesis import strategies as st
from ticks import tick

from adversary import exchange_search as adversary
from adversary import port_search
from adversary.worst_paths import worst
from haptic_device.config.parameters import POLICIES
from haptic_device.control import enable_state, faults, records, tool_side_tank
from haptic_device.control.set_position import DAMPER_SLEW
from haptic_sim.exchange import BUDGET, Limits
from haptic_sim.exchange.port import PspmPort, port_of
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.lockstep.lockstep import Network
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

BOUND = 0.005 + 1e-7  # [J] exchange.budget, and what rounding of a path of newtons makes of it
FAST = 2000.0, 2.0, 0.25e-3  # stiffness, damping, period
SLOW = 1000.0, 0.25, 1e-3


def searched():
    """Name, settings, adversary and seed of each path that is kept."""
    for gains, late in itertools.product((SLOW, FAST), (adversary.FREE, 0, 20)):
        yield f"pspm {gains[0]:g} {late}", one_axis("pspm", *gains), adversary.Adversary(late, 0.3), late + 2
    for late in (adversary.FREE, 1, 20):
        yield f"direct {late}", one_axis("direct"), adversary.Adversary(late), 1
    yield "pspm controlled", one_axis("pspm", passivity__control=True), adversary.Adversary(loss=0.3), 5
    # far stronger than the budget: books that hold for full tanks too, at the force limit and with missed ticks
    for limit, reach, rough in itertools.product((2.0, 20.0), (0.3, 1.0, 5.0), (0, 1)):
        full = adversary.Adversary(loss=0.2, reach=reach, rough=rough, books=1, full=1)
        yield f"pspm {limit:g} {reach:g} {rough}", one_axis("pspm", *FAST, force__limit=limit), full, 3


SEARCHED = {name: rest for name, *rest in searched()}


@pytest.mark.parametrize("name", SEARCHED)
def test_no_path_that_is_found_gives_more_than_the_budget_or_is_credited_more_than_the_truth(name):
    settings, against, seed = SEARCHED[name]
    found = worst(name, settings, against, 600, seed)
    assert found.overcredit <= 1e-9
    if not against.books:
        assert found.energy <= BOUND
        assert found.force <= settings["coupling"]["limit"][0, 0] + 1e-9
        # springs have the slew, and dampers their share on top of it
        assert found.change <= (1.0 + DAMPER_SLEW) * settings["exchange"]["slew"][0, 0] * settings["period"][0] + 1e-8


def test_the_same_search_comes_close_to_the_budget():
    assert worst("pspm budget", one_axis("pspm"), adversary.Adversary(loss=0.3), 2500, seed=0).energy > 0.5 * BOUND
    richer = one_axis("pspm", exchange__budget=0.05)
    assert BOUND < worst("pspm richer", richer, adversary.Adversary(loss=0.3), 2500, seed=0).energy <= 0.05 + 1e-7


def test_what_an_encoder_step_hides_is_paid_for():
    step = 5e-6
    given = one_axis("pspm", *FAST, counts=1.0 / step)
    against = adversary.Adversary(coulomb=2000.0 * step / 2.0, reach=0.1, books=1, full=1)
    at_its_ends = given["coupling"]["limit"][0, 0] * step / 2.0
    assert worst("pspm counts", given, against, 800, seed=4).overcredit <= at_its_ends


@few(16)
@given(
    seed=st.integers(0, 2**32),
    scale=st.sampled_from([(1.0, 1.0), (2.0, 0.5), (0.5, 2.0)]),
    limit=st.sampled_from([2.0, 20.0]),
    reach=st.sampled_from([0.3, 1.0, 3.0]),
    wall=st.sampled_from([0.0, 1000.0]),
    missed=st.sampled_from([0.0, 0.1, 0.5]),
)
def test_nor_in_three_axes_with_a_scaled_device_a_wall_and_missed_ticks(seed, scale, limit, reach, wall, missed):
    assert credited("pspm", seed, scale, limit, reach, wall, missed) <= 1e-9


@few(20)
@given(
    scene=st.sampled_from(["wall", "push_block", "ratchet"]),
    way=st.lists(st.tuples(st.floats(-0.02, 0.03), st.floats(-1.0, 1.0), st.floats(0.0, 0.003)), min_size=2),
    gaps=st.lists(st.integers(0, 25), min_size=100, max_size=100),
    limits=st.lists(st.sampled_from([None, 0, 1, 2, 3, 5, 20]), min_size=100, max_size=100),
)
@example("wall", [(0.02, 1.0, 0.003)] * 60, [20] * 100, [1] * 100)
@example("push_block", [(0.02, 1.0, 0.003), (-0.02, -1.0, 0.0)] * 30, [20] * 100, [1] * 100)
def test_the_tool_port_supplies_no_more_than_was_shipped_and_its_budget(scene, way, gaps, limits):
    """In closed form, and in pymunk's world, which takes a sub-step in several steps; whatever time is left out."""
    simulation = Simulation(reduce_scene(load(scene), None if scene == "wall" else "impulse"), port=port_of("pspm"))
    at = simulation.scene.tool.pose
    gains, shipped, first, time_ns = tuple(GAINS.values()), 0.0, None, 0
    for (x, v, energy), gap, most in zip(way, gaps, limits, strict=False):
        shipped, time_ns = shipped + energy, time_ns + gap * 1_000_000
        first = shipped if first is None else first
        port = ((at[0] + x, at[1] - x, at[2] + 10.0 * x), (v, 0.0, 0.0))
        simulation.exchange(HandleSample(time_ns, *port, *gains, energy=shipped), most)
        assert simulation.ledger.supplied <= shipped - first + BUDGET + 1e-9


@pytest.mark.parametrize("exchange", ["direct", "pspm"])
def test_a_tool_led_evenly_goes_neither_ahead_nor_behind_whether_a_port_holds_its_handle_or_not(exchange):
    """Nothing brakes it, so that the coupling has no stretch; held at a sub-step's end, the handle would be ahead."""
    simulation = Simulation(reduce_scene(load("push_block"), "impulse"), port=port_of(exchange))
    (x, y, angle), speed = simulation.scene.tool.pose, -0.1
    for number in range(1500):
        sample = HandleSample(
            number * 1_000_000,
            (x + speed * number * 1e-3, y + 1.0, angle),
            (speed, 0.0, 0.0),
            *GAINS.values(),
            energy=1.0 * number,
        )
        answer = simulation.exchange(sample)
    assert answer.position[0] == pytest.approx(sample.position[0], abs=1e-6)


class Deaf(PspmPort):
    """A port that takes every sub-step for one of a single step."""

    def receive(self, sample, sub_step, inner=1):
        return super().receive(sample, sub_step)


def test_a_world_of_several_steps_a_sub_step_draws_the_budget_at_most_and_more_where_the_port_does_not_know_of_them():
    budget = 1e-6
    told, deaf = (
        port_search.search(lambda made=made: made(budget), handle, evaluations=800, seed=1, inner=5)
        for made in (PspmPort, Deaf)
    )
    assert 0.9 * budget < told.energy <= budget * (1.0 + 1e-9) < deaf.energy


def test_a_world_that_leaves_time_out_draws_the_budget_at_most():
    every, budget = [(1,), (0, 4), (2, 4, 1), (3, 0, 0, 1)], 1e-6
    searches = (port_search.search(lambda: PspmPort(budget), handle, 0.25e-3, limits=each) for each in every)
    assert 0.5 * budget <= max(found.energy for found in searches) <= budget * (1.0 + 1e-9) + 1e-12


SMOOTH = 1.0 + tool_side_tank.DAMPER_SLEW


@pytest.mark.parametrize("limits", [Limits(5.0, 1.0, 400.0), Limits(20.0, 1.0, 2000.0)])
def test_no_samples_pull_a_held_tool_harder_than_the_limit_or_change_the_pull_faster_than_the_slew(limits):
    pull, change = port_search.fastest(lambda: PspmPort(BUDGET, limits), handle, 300)
    assert pull <= limits.force * (1.0 + 1e-9)
    assert change <= SMOOTH * limits.slew * 1e-3 * (1.0 + 1e-9)
    assert change > 0.9 * limits.slew * 1e-3  # they come up to it
    pull, change = port_search.fastest(lambda: port_of("direct"), handle, 300)
    assert pull > limits.force and change > 10.0 * limits.slew * 1e-3


def handle(number, position, velocity, energy):
    """A handle sample of one axis."""
    moving = (position, 0.0, 0.0), (velocity, 0.0, 0.0)
    return HandleSample(number * 1_000_000, *moving, *GAINS.values(), energy=energy)


def tank_of(stiffness, force, slew, energy):
    """Rules and memory of the tool's port with a damper of 2 N s/m, at 4 kHz."""
    rules, memory = np.zeros(tool_side_tank.RULES), np.zeros(tool_side_tank.MEMORY)
    rules[:3], rules[3:6], rules[6:8] = stiffness, 2.0, tool_side_tank.worst(stiffness, 2.0, 0.25e-3)
    rules[8:10], rules[10:12], memory[tool_side_tank.TANK] = force, np.multiply(slew, 0.25e-3), energy
    return rules, memory


@given(energy=st.floats(0.0, 0.2), pull=st.floats(-200.0, 200.0), stiffness=st.sampled_from([0.0, 500.0, 5000.0]))
def test_a_pull_that_is_allowed_can_be_let_go_slowly_whatever_the_tool_takes(energy, pull, stiffness):
    """The tool takes the most from the tank that a sub-step can, and the samples want the pull gone."""
    damping, h, slew, still, before = 2.0, 0.25e-3, 500.0, (0.0, 0.0, 0.0), 0.0
    rules, memory = tank_of(stiffness, 40.0, slew, energy)
    aim, speed = (pull / stiffness, 0.0) if stiffness else (0.0, pull / damping)
    for k in range(800):
        wanted = k < 400
        tool_side_tank.drive(rules, memory, (wanted * aim, 0.0, 0.0), (wanted * speed, 0.0, 0.0), still)
        made = stiffness * memory[tool_side_tank.AIM] + damping * memory[tool_side_tank.SPEED]
        assert abs(made - before) <= SMOOTH * slew * h * (1.0 + 1e-9)
        memory[tool_side_tank.TANK] -= 0.0 if wanted else rules[tool_side_tank.WORST] * made * made
        assert memory[tool_side_tank.TANK] >= -1e-12
        before = made
    assert abs(made) <= 1e-9


@example(tank=-1e-30, pull=(0.0, 0.0, 0.0), stiffness=500.0)
@example(tank=-1e-30, pull=(30.0, 0.0, 0.5), stiffness=500.0)
@example(tank=1e-2, pull=(1.48e-321, 0.0, 0.0), stiffness=500.0)
@given(
    tank=st.one_of(st.floats(-1e-2, 1e-2), st.floats(-1e-28, 1e-28)),
    pull=st.tuples(*[st.floats(-reach, reach) for reach in (200.0, 200.0, 5.0)]),
    stiffness=st.sampled_from([0.0, 500.0, 5000.0]),
)
def test_whatever_the_tank_holds_the_pull_is_a_finite_share_of_what_is_wanted(tank, pull, stiffness):
    """A tank may lie below zero by rounding: from then on it pays for nothing, and says so in numbers."""
    damping, still = 2.0, (0.0, 0.0, 0.0)
    rules, memory = tank_of(stiffness, (40.0, 2.0), (500.0, 25.0), tank)
    aim = tuple(one / stiffness if stiffness else 0.0 for one in pull)
    speed = tuple(0.0 if stiffness else one / damping for one in pull)
    asked = [stiffness * place + damping * rate for place, rate in zip(aim, speed, strict=True)]
    for _ in range(20):
        tool_side_tank.drive(rules, memory, aim, speed, still)
        aims, speeds = (memory[place : place + 3] for place in (tool_side_tank.AIM, tool_side_tank.SPEED))
        made = stiffness * aims + damping * speeds
        for one, wanted in zip(made, asked, strict=True):
            assert 0.0 <= one * np.sign(wanted) <= abs(wanted) * (1.0 + 1e-9)
        assert tank > 0.0 or abs(made).max() < 1e-150  # whose energy is 0 in numbers


@pytest.mark.parametrize("enabled", [True, False])
def test_counts_that_are_old_pay_nothing_back_and_let_nothing_rise(enabled):
    given = one_axis("pspm", *FAST)
    memory, row = pressed(given)
    before = books(given, memory, row)
    row["deadline"] += given["period"][0] * 1e9
    row["command"], memory["enable"]["ramp"] = (enable_state.ENABLE, 0.5) if enabled else (0, 1.0)
    tick(given, memory, row)
    assert row["engage"][0] == (0.5 if enabled else 0.0)
    assert books(given, memory, row) <= before
    row["deadline"] += given["period"][0] * 1e9
    row["latched"] = row["deadline"]
    tick(given, memory, row)
    assert row["engage"][0] == pytest.approx(0.5 + given["period"][0] / given["engage"]["time"][0] if enabled else 0.0)


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("way", [-3e-4, 0.0, 3e-4])
def test_gains_that_change_on_old_counts_wait_for_the_next_and_are_paid_for_whatever_the_handle_did(way, policy):
    for change in (0.5, 2.0):
        given = one_axis("pspm", 1000.0, 1.0, 0.25e-3)
        given["passivity"]["policy"] = POLICIES.index(policy)
        (memory, row), period = pressed(given), given["period"][0]
        before, force = books(given, memory, row), row["force_on_handle"][0, 0]
        given["coupling"]["stiffness"], given["version"] = change * given["coupling"]["stiffness"], 1.0
        row["deadline"] += period * 1e9
        tick(given, memory, row)
        assert row["force_on_handle"][0, 0] == force
        row["latched"], row["deadline"] = row["deadline"], row["deadline"] + period * 1e9
        after(given, memory, row, period, way, faults.FRESH)
        gained = force * way - 0.5 * given["hardware"]["damping"][0, 0] * way * way / period
        assert row["fault"][0] == faults.NONE
        assert before - books(given, memory, row) >= gained - given["hardware"]["position_per_count"][0, 0] * force


@pytest.mark.parametrize("way", [-1e-3, 1e-3])
def test_a_long_hold_pays_for_what_the_force_gave_and_counts_the_worst_time_where_the_motor_was_cut_in_it(way):
    given = one_axis("pspm", *FAST)
    memory, row = pressed(given)
    before, force = books(given, memory, row), row["force_on_handle"][0, 0]
    after(given, memory, row, 0.01, way, faults.FRESH)
    gained = before - books(given, memory, row)
    drag = given["hardware"]["damping"][0, 0] * way * way / 0.01
    assert 0.0 <= gained - (force * way - drag) < 0.1 * abs(force * way)
    (memory, row), way, hold, b = pressed(given), 20.0 * way, 0.4, given["hardware"]["damping"][0, 0]
    after(given, memory, row, hold, way, faults.FRESH | faults.WATCHDOG)
    assert row["fault"][0] == faults.DEVICE_WATCHDOG and not row["motor"].any()
    assert before - books(given, memory, row) == pytest.approx(max(0.0, force * way) - b * way * way / hold, rel=1e-3)
    most = max(0.0, force * way) + force**2 * hold / (16.0 * b)  # cut half way: this much it may have given
    assert memory["account"]["given"][0] == pytest.approx(most, rel=1e-6)


@pytest.mark.parametrize("periods", [1, 3, 11])
def test_a_hand_that_stretches_a_slack_coupling_in_one_hold_is_credited_what_the_damper_took_at_most(periods):
    given, (memory, row) = one_axis("pspm"), adversary.engaged()
    row["command"], row["tool_session"], row["tool_contact"], period = enable_state.ENABLE, 1.0, 1.0, given["period"][0]
    for _ in range(5):
        after(given, memory, row, period, 0.0, faults.FRESH)
    after(given, memory, row, periods * period, periods * -1e-4, faults.FRESH)
    assert row["force_on_handle"][0, 0] > 0.0
    assert books(given, memory, row) <= given["hardware"]["damping"][0, 0] * periods * 1e-8 / period + 1e-9


def test_steady_motion_through_a_late_tick_costs_what_the_spring_may_gain_not_what_any_damper_could():
    given, speed, late = one_axis("pspm", *FAST), 0.1, 0.01
    memory, row = pressed(given)
    for _ in range(5):
        after(given, memory, row, given["period"][0], -speed * given["period"][0], faults.FRESH)
    before = books(given, memory, row)
    after(given, memory, row, late, -speed * late, faults.FRESH)
    assert before - books(given, memory, row) <= 0.0  # the hand paid for it
    assert 2.0 / given["period"][0] * (speed * late) ** 2 > 5e-3  # any damper of 2 N s/m could


@pytest.mark.parametrize("free, way", [(4e-3, 0.0), (-1e-3, 0.0), (1e-4, 2e-3)])
def test_what_a_long_hold_leaves_owing_the_spring_pays_as_fast_as_the_slew_allows_and_no_more(free, way):
    given = one_axis("pspm", *FAST, passivity__control=True)
    memory, row = pressed(given)
    force, hold = row["force_on_handle"][0, 0], 0.01
    memory["account"]["free"] = free
    stretch = force / 2000.0 - way
    after(given, memory, row, hold, way, faults.FRESH)
    for _ in range(40):
        after(given, memory, row, given["period"][0], 0.0, faults.FRESH)
    stored, now = 0.5 * 2000.0 * stretch * stretch, memory["account"]["stored"][0]
    debt = max(0.0, (1000.0 - given["hardware"]["damping"][0, 0] / hold) * way * way - free)
    assert row["force_on_handle"][0, 0] * force > 0.0 and abs(row["force_on_handle"][0, 0]) <= abs(force) * (1.0 + 1e-9)
    assert now == pytest.approx(max(0.0, stored - debt), rel=0.05)
    assert memory["account"]["free"][0] == pytest.approx(min(0.0, stored - debt) if debt > 0.0 else free, abs=1e-4)


def books(given, memory, row):
    """What account and spring may still give, or was shipped, less the budget [J]."""
    return adversary.booked(given[0], memory[0], row.view(records.TICK)[0])


def after(given, memory, row, time, way, status):
    """One tick that comes a time [s] after the last, with the handle moved by a way [m]."""
    row["latched"] += time * 1e9
    row["deadline"], row["device_status"] = row["latched"], status
    row["counts"][0, 0] += round(way / given["hardware"]["position_per_count"][0, 0])
    row["tool_answered"] += 1.0
    tick(given, memory, row)


def pressed(given):
    """Memory and row of a servo whose spring is stretched by 4 mm, which has been paid for."""
    (memory, row), step = adversary.engaged(0.02), given["hardware"]["position_per_count"][0, 0]
    for k in range(200):
        row["latched"] = row["deadline"] = (k + 1) * given["period"][0] * 1e9
        row["command"], row["device_status"], row["counts"][0] = enable_state.ENABLE, faults.FRESH, round(-0.004 / step)
        row["tool_session"], row["tool_answered"], row["tool_contact"] = 1.0, k + 1.0, 1.0
        tick(given, memory, row)
    assert row["force_on_handle"][0, 0] > 1.0
    return memory, row


def test_a_wall_behind_a_bad_network_is_steady_and_passive_and_direct_exchange_gives_one_budget_at_most():
    network = Network(0.02, 0.01, 0.1, 3)
    motion = {"start": [0.03, 0.0, 0.0], "target": [0.004, 0.0, 0.0], "duration": 6.0}
    system, direct = (demo_system(name, "wall", network, motion) for name in ("pspm", "direct"))
    rows = system.run(4.3)
    assert system.plant_memory["energy_given"][0] <= BOUND
    before, end = rows[-6000:-4000].force_coupling[:, 0], rows[-2000:].force_coupling[:, 0]
    assert np.ptp(end) < np.ptp(before) + 0.2  # [N] nothing that grows
    assert np.mean(end) == pytest.approx(np.mean(before), rel=0.05)  # nothing that drifts
    assert np.mean(end) > 1.0
    stretch = rows[-2000:].tool_position[:, 0] - rows[-2000:].position[:, 0]
    assert np.ptp(end) < 0.1 and np.mean(end) == pytest.approx(2000.0 * np.mean(stretch), rel=0.05)
    direct.run(1.9)
    assert direct.plant_memory["energy_given"][0] <= BOUND


@pytest.mark.parametrize("field", ["tool_position", "tool_velocity", "tool_effort", "tool_energy", "tool_age", "drag"])
def test_what_is_not_a_number_stops_the_motor_and_books_no_force(field):
    for value in (np.nan, np.inf):
        given = one_axis("pspm", *FAST)
        memory, row = pressed(given)
        before = books(given, memory, row)
        row[field] = value
        after(given, memory, row, given["period"][0], 0.0, faults.FRESH)
        gone = field == "tool_age"  # an age that is none is that of a tool that is no more
        assert row["fault"][0] == (faults.NONE if gone else faults.NOT_A_NUMBER)
        for _ in range(100 if gone else 0):  # its force fades within the slew
            after(given, memory, row, given["period"][0], 0.0, faults.FRESH)
        assert not row["motor"].any() and not row["force_on_handle"].any()
        if not gone:
            assert row["engage"][0] == memory["account"]["stored"][0] == 0.0 and not memory["rows"]["weight"].any()
        assert books(given, memory, row) <= before + 1e-9
