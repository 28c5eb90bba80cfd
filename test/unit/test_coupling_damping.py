# SPDX-License-Identifier: Apache-2.0
"""What a coupling to any passive simulation needs: one formula for driver and command line, against exact values."""

import numpy as np
import pytest
from examples import few, tries
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import device, values

from adversary.horizon import energy_generated_over_horizon
from haptic_device.control import controller_config, gain_check
from haptic_device.control.passivity import coupling_damping, least_damping
from haptic_device.theory.assessment import Display, assess
from haptic_device.theory.coupling_damping import least_damping_for_any_simulation
from haptic_device.theory.mu import mu_margin
from haptic_device.theory.transfer import wall_transfer

DESKTOP = device(axes=1)
DRAWS = tries(96)
ROUNDING = 1e-9  # [J/m²] of K = 1 N/m


def refusal(display, **gains):
    """What the driver says of gains on a device with this damping and this delay of its motor."""
    axis = DESKTOP.axes[0].model_copy(update={"damping": display.physical_damping})
    late = display.delay_samples * display.period
    described = DESKTOP.model_copy(update={"axes": (axis,), "actuation_delay": late})
    coupling = {"coupling__stiffness": 0.0, "coupling__damping": 0.0, "servo__rate": 1.0 / display.period}
    settings = controller_config.settings_from(described, values("haptic_driver", **coupling | gains))[0]
    return gain_check.refusal(settings, late)


def refusal_of_coupling(display):
    return refusal(display, coupling__stiffness=display.stiffness, coupling__damping=display.damping)


def refusal_of_wall(display):
    wall = {"wall__stiffness": (display.stiffness,), "wall__damping": (display.damping,)}
    return refusal(display, wall__normals=(1.0, 0.0), wall__offsets=(0.0,), **wall)


def random_display(rng, draw):
    """Whole and fractional delays, B = 0 in every fourth; b just beside a need of coupling or wall, or anywhere."""
    period = 1.0 / round(10.0 ** rng.uniform(np.log10(500.0), 4.0))
    stiffness = 10.0 ** rng.uniform(0.0, 5.0)
    damping = stiffness * period * 10.0 ** rng.uniform(-2.0, 1.0) * (draw % 4 > 0)
    delay = [0.0, rng.integers(1, 5), rng.uniform(0.0, 1.0), rng.uniform(0.0, 5.0)][draw // 4 % 4]
    need = [coupling_damping, least_damping][draw // 16 % 2](stiffness, damping, period, float(delay * period))
    share = [1.0 - 1e-6, 1.0 + 1e-6, 10.0 ** rng.uniform(-0.3, 0.3)][draw % 3]
    return Display(stiffness, damping, share * need, period, delay_samples=float(delay))


def test_command_and_driver_agree_in_all_random_settings_with_delays():
    rng, agreed, verdicts = np.random.default_rng(38), 0, set()
    for draw in range(DRAWS):
        display = random_display(rng, draw)
        found = assess(display)
        taken = refusal_of_coupling(display) == "", refusal_of_wall(display) == ""
        same_coupling, wall = found.mu_passive == taken[0], found.margin > 0.0
        # of a damper that acts late a closed form asks for more than the command, which knows its exact need
        exact = display.damping == 0.0 or display.delay_samples == 0.0
        agreed += same_coupling and (taken[1] == wall if exact else taken[1] <= wall)
        verdicts.add((*taken, exact))
    assert agreed == DRAWS
    # passive as neither, as a wall only, as both; a coupling never needs less than a wall
    assert verdicts == {(*taken, exact) for taken in ((0, 0), (0, 1), (1, 1)) for exact in (0, 1)}


def test_a_coupling_that_a_wall_of_its_gains_does_not_show_active_is_refused_by_both():
    display = Display(1000.0, 0.0, 1.58, 1e-3, delay_samples=1.0)
    found = assess(display)
    assert found.passive and not found.mu_passive and found.b_required_mu == pytest.approx(2.0)
    assert refusal_of_wall(display) == "" and "needs b > 2 N s/m" in refusal_of_coupling(display)


def test_a_lag_of_the_velocity_is_not_credited_to_a_coupling():
    prompt, lagging = (assess(Display(1000.0, 0.3, 1.0, 1e-3, velocity_lag=lag)) for lag in (0.0, 2e-3))
    assert lagging.b_required < prompt.b_required
    assert lagging.b_required_mu == prompt.b_required_mu == pytest.approx(0.8)


@few(40)
@given(st.floats(-0.6, 3.0), st.floats(0.0, 4.0), st.sampled_from([0.0, 0.3, 10.0]))
def test_what_a_coupling_is_asked_for_is_its_exact_need_at_a_constant_delay_and_more_only_of_a_late_damper(
    damping, delay, lag
):
    wall = wall_transfer(1.0, damping, 1.0, lag)
    asked = coupling_damping(1.0, damping, 1.0, delay)
    assert least_damping_for_any_simulation(wall, 1.0, delay).damping <= asked * (1.0 + 1e-9)
    if np.isfinite(asked):
        assert mu_margin(wall, 1.0, 1.001 * asked, delay) > 0.0
    for viscous, late in ((damping, 0.0), (min(0.0, damping), delay)):
        exact = least_damping_for_any_simulation(wall_transfer(1.0, viscous, 1.0), 1.0, late).damping
        assert coupling_damping(1.0, viscous, 1.0, late) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("late", [0.0, 0.3, 1.0, 1.5])
@pytest.mark.parametrize("damping", [0.0, -0.3])
def test_energy_is_found_just_below_what_a_coupling_is_asked_for_and_none_at_it(damping, late):
    asked, writes = coupling_damping(1.0, damping, 1.0, late), np.arange(60) + late
    assert energy_generated_over_horizon(1.0, damping, asked, 1.0, writes) < ROUNDING
    assert energy_generated_over_horizon(1.0, damping, 0.97 * asked, 1.0, writes) > 1e3 * ROUNDING


@pytest.mark.parametrize("late", [0.1, 0.999])
@pytest.mark.parametrize("damping", [-0.3, 0.0, 2.0])
def test_no_sequence_of_delays_up_to_the_one_that_is_counted_needs_more_of_a_coupling(damping, late):
    rng, ticks = np.random.default_rng(6), np.arange(40.0)
    asked = coupling_damping(1.0, damping, 1.0, late)
    shares = [np.round(rng.beta(shape, shape, ticks.size), 3) for shape in (0.05, 0.2, 1.0, 5.0)]
    for share in (*shares, ticks % 2, ticks % 3 < 1, ticks % 3 < 2):
        assert energy_generated_over_horizon(1.0, damping, asked, 1.0, ticks + late * share) < ROUNDING


def test_delays_that_alternate_need_more_of_a_late_damper_than_a_constant_one():
    ticks = np.arange(60.0)
    constant, alternating = ticks + 0.999, ticks + 0.999 * (ticks % 2)
    assert energy_generated_over_horizon(0.0, 1.0, 1.05, 1.0, constant) < ROUNDING
    assert energy_generated_over_horizon(0.0, 1.0, 1.25, 1.0, alternating) > 1e3 * ROUNDING


@pytest.mark.parametrize("late", [0.05, 0.5, 0.95])
def test_a_store_of_the_last_two_ways_proves_what_a_late_damper_is_charged_for_delays_that_vary(late):
    """(1−φ)(a₁−a₀)² + φ(a₁−a₋)² ≤ 4√(1+j) a₁² + V(a₀, a₋) − V(a₁, a₀), a the ways of the stretch, any φ in 0 … j.

    V(a, a₋) = (2 + 1.4 j) a² + .5 j a a₋ + 1.9 j a₋². Linear in φ, so that both ends are enough.
    """
    now, both, before = 2.0 + 1.4 * late, 0.25 * late, 1.9 * late
    for share in (0.0, late):
        prompt = 1.0 - share
        form = [
            [4.0 * np.sqrt(1.0 + late) - now - 1.0, prompt - both, share],
            [prompt - both, now - before - prompt, both],
            [share, both, before - share],
        ]
        assert np.linalg.eigvalsh(form)[0] > 0.0
