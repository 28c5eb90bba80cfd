# SPDX-License-Identifier: Apache-2.0
"""Whatever samples come: the operator gets no more than the budget, the tool no more than what was shipped."""

import itertools

import numpy as np
import pytest
import stalling
from examples import few
from exchange_systems import GAINS, credited, demo_system, one_axis
from hypothesis import example, given
from hypothesis import strategies as st
from ticks import tick

from adversary import exchange_search as adversary
from adversary import port_search
from adversary.worst_paths import worst
from haptic_device.config.parameters import POLICIES
from haptic_device.control import enable_state, faults, tool_side_tank, virtual_coupling
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
        period = settings["period"][0]
        assert found.energy <= BOUND
        assert found.force <= settings["coupling"]["limit"][0, 0] + 1e-9
        assert found.change <= settings["exchange"]["slew"][0, 0] * period * (1.0 + 1e-9)


def test_the_same_search_finds_ten_budgets_from_direct_exchange_and_comes_close_to_the_budget_of_others():
    for late in (adversary.FREE, 1, 20):
        found = worst(f"direct {late}", one_axis("direct"), adversary.Adversary(late), 1500, seed=1)
        assert found.energy > 10.0 * BOUND
    assert worst("pspm budget", one_axis("pspm"), adversary.Adversary(loss=0.3), 2500, seed=0).energy > 0.5 * BOUND
    richer = one_axis("pspm", exchange__budget=0.05)
    assert BOUND < worst("pspm richer", richer, adversary.Adversary(loss=0.3), 2500, seed=0).energy <= 0.05 + 1e-7
    direct = one_axis("direct")
    found = adversary.search(direct, adversary.Adversary(loss=0.3), evaluations=200, seed=5)
    assert found.change > 5.0 * direct["exchange"]["slew"][0, 0] * direct["period"][0]


def test_what_an_encoder_step_hides_is_paid_for():
    given, step = one_axis("pspm", *FAST), 5e-6
    given["hardware"]["position_per_count"][:, 0] = step
    against = adversary.Adversary(coulomb=2000.0 * step / 2.0, reach=0.1, books=1, full=1)
    at_its_ends = given["coupling"]["limit"][0, 0] * step / 2.0
    assert worst("pspm counts", given, against, 800, seed=4).overcredit <= at_its_ends


@few(16)
@given(
    seed=st.integers(0, 2**32),
    scale=st.sampled_from([(1.0, 1.0), (2.0, 0.5), (0.5, 2.0)]),
    limit=st.sampled_from([2.0, 20.0]),
    reach=st.sampled_from([0.3, 1.0, 3.0]),
    beside=st.sampled_from([(0.0, 0.0), (1000.0, 0.0), (0.0, 0.1), (0.0, 0.5)]),
)
def test_nor_in_three_axes_with_a_scaled_device_beside_a_wall_or_with_missed_ticks(seed, scale, limit, reach, beside):
    wall, missed = beside  # what a wall of the servo gives over a missed tick is the observer's business
    assert credited("pspm", seed, scale, limit, reach, wall, missed) <= 1e-9


def test_fading_and_returning_costs_what_an_encoder_step_hides_of_its_change_of_force():
    given, step = one_axis("pspm", 2000.0, 2.0, 0.25e-3), 5e-6
    given["hardware"]["position_per_count"][:, 0] = step
    memory, row, _ = pressed(given)
    force, before = row["force_on_handle"][0, 0], 0.5 * given["exchange"]["tank"][0]
    memory["tank"]["level"] = before
    half = 0.06 + 0.07  # [s] age at which half of the force is left
    for age in [0.0, *[half] * 10, *[0.0] * 400]:
        row["tool_age"] = age
        after(given, memory, row, given["period"][0], 0.0, faults.FRESH)
    assert force == pytest.approx(8.0, rel=0.01)
    assert before - memory["tank"]["level"][0] == pytest.approx(2.0 * 0.5 * force * step / 2.0, rel=0.02)


@few(30)
@given(
    genes=st.lists(st.tuples(*[st.floats(-3.0, 3.0) for _ in range(adversary.GENES)]), min_size=4, max_size=60),
    repeats=st.integers(1, 8),
    late=st.sampled_from([adversary.FREE, 0, 3, 50]),
    loss=st.floats(-3.0, 1.0),
)
def test_no_samples_and_no_path_give_more_than_the_budget(genes, repeats, late, loss):
    path = np.repeat(np.array(genes), repeats, axis=0)
    given = one_axis("pspm")
    memory, row = adversary.engaged()
    scale, watched, against = adversary.scale_of(given), np.zeros(4), adversary.Adversary(late, loss)
    assert adversary.energy_given(given, memory, row, path, scale, against, watched) <= BOUND


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
    memory, row, before = pressed(given)
    row["deadline"] += given["period"][0] * 1e9
    row["command"], memory["enable"]["ramp"] = (enable_state.ENABLE, 0.5) if enabled else (0, 1.0)
    tick(given, memory, row)
    assert row["engage"][0] == (0.5 if enabled else 0.0)
    assert memory["tank"]["level"][0] <= (before if enabled else 0.0)
    row["deadline"] += given["period"][0] * 1e9
    row["latched"] = row["deadline"]
    tick(given, memory, row)
    assert row["engage"][0] == pytest.approx(0.5 + given["period"][0] / given["engage"]["time"][0] if enabled else 0.0)


@pytest.mark.parametrize("way", [-3e-4, 0.0, 3e-4])
def test_gains_that_change_on_old_counts_are_paid_for_whatever_the_handle_did_meanwhile(way):
    for change in (0.5, 2.0):
        given = one_axis("pspm", 1000.0, 1.0, 0.25e-3)
        given["passivity"]["policy"] = POLICIES.index("off")  # else gains do not change on old counts
        (memory, row, tank), period = pressed(given), given["period"][0]
        before, forces = tank + energy(memory, row), [row["force_on_handle"][0, 0]]
        given["coupling"]["stiffness"], given["version"] = change * given["coupling"]["stiffness"], 1.0
        row["deadline"] += period * 1e9
        tick(given, memory, row)
        forces = np.array([*forces, row["force_on_handle"][0, 0]])
        b, step = given["hardware"]["damping"][0, 0], given["hardware"]["position_per_count"][0, 0]
        moved = 0.5 * way + period * (forces - forces.mean()) / (2.0 * b)  # the hand's best
        gained = forces @ moved - b * np.sum(moved**2) / period
        row["latched"], row["deadline"] = row["deadline"], row["deadline"] + period * 1e9
        after(given, memory, row, period, way, faults.FRESH)
        assert abs(forces[1] - forces[0]) > 1.0 and row["fault"][0] == faults.NONE
        assert before - memory["tank"]["level"][0] - energy(memory, row) >= gained - step * np.abs(forces).max()


@pytest.mark.parametrize("way", [-1e-3, 1e-3])
def test_a_long_hold_pays_for_what_the_force_gave_and_leaves_neither_debt_nor_credit_where_the_motor_was_cut(way):
    given = one_axis("pspm", *FAST)
    memory, row, before = pressed(given)
    stored, force = energy(memory, row), row["force_on_handle"][0, 0]
    after(given, memory, row, 0.01, way, faults.FRESH)
    gained = before + stored - memory["tank"]["level"][0] - energy(memory, row)
    drag = given["hardware"]["damping"][0, 0] * way * way / 0.01
    assert 0.0 <= gained - (force * way - drag) < 0.1 * abs(force * way)
    memory, row, before = pressed(given)
    after(given, memory, row, 0.4, 20.0 * way, faults.FRESH | faults.WATCHDOG)
    assert row["fault"][0] == faults.DEVICE_WATCHDOG and not row["motor"].any()
    assert before > 0.0 and memory["tank"]["level"][0] == 0.0 and memory["spring"]["stiffness"][0, 0] == 0.0


def test_steady_motion_through_a_late_tick_costs_what_the_spring_may_gain_not_what_any_damper_could():
    given, speed, late = one_axis("pspm", 2000.0, 2.0, 0.25e-3), 0.1, 0.01
    memory, row, _ = pressed(given)
    for _ in range(5):
        after(given, memory, row, given["period"][0], -speed * given["period"][0], faults.FRESH)
    before = memory["tank"]["level"][0] + energy(memory, row)
    after(given, memory, row, late, -speed * late, faults.FRESH)
    assert before - memory["tank"]["level"][0] - energy(memory, row) <= 0.0  # the hand paid for it
    assert 2.0 / given["period"][0] * (speed * late) ** 2 > 5e-3  # any damper of 2 N s/m could


@pytest.mark.parametrize("tank, way", [(4e-3, 0.0), (-1e-3, 0.0), (1e-4, 2e-3)])
def test_what_a_long_hold_leaves_owing_the_spring_pays_at_once_and_no_more(tank, way):
    given = one_axis("pspm", *FAST)
    memory, row, _ = pressed(given)
    force = row["force_on_handle"][0, 0]
    memory["tank"]["level"] = tank
    stretch = memory["spring"]["set_position"][0, 0] - row["position"][0, 0] - way
    stored, hold = 0.5 * 2000.0 * stretch * stretch, 0.01
    after(given, memory, row, hold, way, faults.FRESH)
    debt = max(0.0, (1000.0 - given["hardware"]["damping"][0, 0] / hold) * way * way - tank)
    assert energy(memory, row) == pytest.approx(max(0.0, stored - debt), rel=0.05)
    assert memory["tank"]["level"][0] == pytest.approx(min(0.0, stored - debt) if debt > 0.0 else tank, abs=1e-4)
    assert row["force_on_handle"][0, 0] * force > 0.0 and abs(row["force_on_handle"][0, 0]) <= abs(force) * (1.0 + 1e-9)


@pytest.mark.parametrize("method, share, longest", [("local", 0.05, 40), ("pspm", 0.05, 16)])
def test_missed_ticks_by_the_hundred_give_no_more_than_the_budget(method, share, longest):
    """A tool at a wall, of 0.95 of what b covers at the period: a hold of two periods is beyond."""
    given, rows = stalling.pressed(method, 0.95, share, longest)
    assert np.count_nonzero(np.diff(rows.latched) == 0.0) > 1000  # ticks
    assert np.abs(rows.force_coupling[:, 0]).max() > 1.5
    assert given <= 0.005


def energy(memory, row):
    """In the coupling's spring [J]."""
    stretch = memory["spring"]["set_position"][0, 0] - row["position"][0, 0]
    return virtual_coupling.spring_store(memory["spring"]["stiffness"][0, 0], memory["spring"]["limit"][0, 0], stretch)


def after(given, memory, row, time, way, status):
    """One tick that comes a time [s] after the last, with the handle moved by a way [m]."""
    row["latched"] += time * 1e9
    row["deadline"], row["device_status"] = row["latched"], status
    row["counts"][0, 0] += round(way / given["hardware"]["position_per_count"][0, 0])
    row["tool_answered"] += 1.0
    tick(given, memory, row)


def pressed(given):
    """Memory and row of a servo whose spring has been paid for, and its tank [J]."""
    (memory, row), step = adversary.engaged(), given["hardware"]["position_per_count"][0, 0]
    for k in range(3):
        row["latched"] = row["deadline"] = (k + 1) * given["period"][0] * 1e9
        row["command"], row["device_status"], row["counts"][0] = enable_state.ENABLE, faults.FRESH, round(-0.004 / step)
        row["tool_session"], row["tool_answered"], row["tool_contact"] = 1.0, k + 1.0, 1.0
        if k == 1:
            memory["spring"]["set_position"][0, 0], memory["tank"]["level"] = 0.0, 0.02
            memory["spring"]["force"][0, 0] = 0.004 * given["coupling"]["stiffness"][0, 0]
        tick(given, memory, row)
    assert row["force_on_handle"][0, 0] > 1.0
    return memory, row, float(memory["tank"]["level"][0])


def test_a_wall_behind_a_bad_network_is_steady_and_passive_and_direct_exchange_is_not():
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
    assert direct.plant_memory["energy_given"][0] > 0.1


@pytest.mark.parametrize("field", ["tool_position", "tool_velocity", "tool_effort", "tool_energy", "tool_age", "drag"])
def test_what_is_not_a_number_stops_the_motor_and_books_no_force(field):
    for value in (np.nan, np.inf):
        given = one_axis("pspm", *FAST)
        memory, row, before = pressed(given)
        stored = virtual_coupling.spring_store(*(memory["spring"][of][0, 0] for of in ("stiffness", "limit")), 0.004)
        row[field] = value
        after(given, memory, row, given["period"][0], 0.0, faults.FRESH)
        gone = field == "tool_age"  # an age that is none is that of a tool that is no more
        assert row["fault"][0] == (faults.NONE if gone else faults.NOT_A_NUMBER)
        assert not row["motor"].any() and not row["force_on_handle"].any()
        if not gone:
            assert row["engage"][0] == memory["spring"]["factor"][0] == memory["spring"]["stiffness"][0, 0] == 0.0
        assert memory["tank"]["level"][0] <= before + stored + 1e-9
