# SPDX-License-Identifier: Apache-2.0
"""What a coupling needs: the closed form for any simulation in step, and one verdict of driver and command line."""

import numpy as np
import pytest
from examples import few, tries
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import device, values

from adversary.horizon import energy_generated_over_horizon
from haptic_device.control import controller_config, gain_check
from haptic_device.control.passivity import least_damping
from haptic_device.theory.assessment import Display, assess
from haptic_device.theory.coupling_damping import least_damping_for_any_simulation
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
    """Whole and fractional delays, B = 0 in every fourth; b just beside the need, or anywhere."""
    period = 1.0 / round(10.0 ** rng.uniform(np.log10(500.0), 4.0))
    stiffness = 10.0 ** rng.uniform(0.0, 5.0)
    damping = stiffness * period * 10.0 ** rng.uniform(-2.0, 1.0) * (draw % 4 > 0)
    delay = [0.0, rng.integers(1, 5), rng.uniform(0.0, 1.0), rng.uniform(0.0, 5.0)][draw // 4 % 4]
    late = float(delay * period)
    share = [1.0 - 1e-6, 1.0 + 1e-6, 10.0 ** rng.uniform(-0.3, 0.3)][draw % 3]
    need = least_damping(stiffness, damping, period, late, late)
    return Display(stiffness, damping, share * need, period, delay_samples=float(delay))


def test_command_and_driver_agree_in_all_random_settings_with_delays_and_ask_the_same_of_a_coupling_as_of_a_wall():
    rng, verdicts = np.random.default_rng(38), set()
    for draw in range(DRAWS):
        display = random_display(rng, draw)
        found, taken = assess(display), refusal_of_coupling(display) == ""
        assert found.mu_passive == taken == (refusal_of_wall(display) == "")
        # where a force is late, the driver's law is enough, and exact only of a spring whole periods late
        exact = display.delay_samples == 0.0 or (display.damping == 0.0 and display.delay_samples % 1.0 == 0.0)
        wall = found.margin > 0.0
        assert taken == wall if exact else taken <= wall
        verdicts.add((taken, wall, exact))
    assert verdicts == {(0, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 1, 1)}


def test_a_lag_of_the_velocity_is_not_credited_to_a_coupling():
    prompt, lagging = (assess(Display(1000.0, 0.3, 1.0, 1e-3, velocity_lag=lag)) for lag in (0.0, 2e-3))
    assert lagging.b_required < prompt.b_required
    assert lagging.b_required_mu == prompt.b_required_mu == pytest.approx(0.8)


@few(40)
@given(st.floats(0.0, 3.0), st.floats(0.0, 4.0))
def test_a_late_spring_that_any_simulation_moves_needs_the_square_of_its_periods_and_a_damper_on_time_itself(
    damping, delay
):
    whole = np.floor(delay)
    square = (1.0 - delay + whole) * (whole + 1.0) ** 2 + (delay - whole) * (whole + 2.0) ** 2
    spring = least_damping_for_any_simulation(wall_transfer(1.0, 0.0, 1.0), 1.0, delay).damping
    assert spring == pytest.approx(0.5 * square, rel=1e-9)
    both = least_damping_for_any_simulation(wall_transfer(1.0, damping, 1.0), 1.0).damping
    assert both == pytest.approx(least_damping(1.0, damping, 1.0, 0.0), rel=1e-9)


@pytest.mark.parametrize("late", [0.0, 0.3, 1.0, 1.5])
@pytest.mark.parametrize("damping", [0.0, -0.3])
def test_energy_is_found_just_below_what_any_simulation_needs_and_none_at_it(damping, late):
    need = least_damping_for_any_simulation(wall_transfer(1.0, damping, 1.0), 1.0, late).damping
    writes = np.arange(60) + late
    assert energy_generated_over_horizon(1.0, damping, need, 1.0, writes) < ROUNDING
    assert energy_generated_over_horizon(1.0, damping, 0.97 * need, 1.0, writes) > 1e3 * ROUNDING
