# SPDX-License-Identifier: Apache-2.0
"""The passivity margin of an operating point, and the refusal of gains beyond it."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import device, values

from bench.reference import closed_forms
from haptic_device.control import controller_config, gain_check, passivity
from haptic_device.nodes.driver import DriverNode

NO_COUPLING = {"coupling__stiffness": 0.0, "coupling__damping": 0.0}
FREE = NO_COUPLING | {"coupling__rotational_damping": 0.0}
ADAPTIVE = {"velocity__estimator": "adaptive_window"}
SLOW = {"physical_damping": 3.0, "servo__rate": 1000.0}
OBLIQUE = 30.0, 60.0
CANCEL = "cancellation__ratio"
CANCELLED = {CANCEL: 0.9, "coupling__rotational_damping": 0.0}


def settings(physical_damping=0.8, scale=(1.0, 1.0), axes=2, **driver):
    described = device(physical_damping, scale=scale, axes=axes)
    return controller_config.settings_from(described, values("haptic_driver", **driver))[0]


def refusal(late=0.0, **given):
    return gain_check.refusal(settings(**given), late)


def shortfall(one, late):
    return gain_check.shortfall(one, gain_check.judge(one, late))


def walls(stiffness, damping, *angles):
    count = len(angles)
    normals = np.array([[np.cos(a), np.sin(a)] for a in np.radians(angles)]).ravel()
    return {
        "wall__normals": tuple(normals),
        "wall__offsets": (0.0,) * count,
        "wall__stiffness": (stiffness,) * count,
        "wall__damping": (damping,) * count,
        **NO_COUPLING,
    }


def coupling(stiffness, damping, **more):
    return {"coupling__stiffness": stiffness, "coupling__damping": damping} | more


def beside(wall, stiffness=2000.0):
    """A wall and a coupling on a device of 3 N s/m."""
    return {"physical_damping": 3.0} | walls(wall, 1.0, 0.0) | coupling(stiffness, 1.0)


TWO = walls(1000.0, 0.05, 0.0, 90.0)  # square to each other: they do not add up
STIFF = coupling(6000.0, 0.2, coupling__rotational_damping=0.0)
ALONE = FREE | CANCELLED | {"late": 0.1e-3}  # of T = .25 ms: 0.9 b √1.4 > b
REFUSED = [
    (
        "wall.stiffness 12000 N/m with damping 0.05 N s/m needs b > 1.55 N s/m at T = 0.25 ms; "
        "the device has 0.8: allowed under 6000 N/m",
        walls(12000.0, 0.05, 270.0),
        walls(5999.0, 0.05, 270.0),
    ),
    ("has 0.8: allowed under 4913 N/m", walls(12000.0, 0.05, 200.0), walls(4912.0, 0.05, 200.0)),  # cos + sin of it
    ("b > 0.8001 N s/m", walls(6000.5, 0.05, 90.0), walls(5999.0, 0.05, 90.0)),  # never as if it fitted
    ("0.8: allowed at no stiffness", walls(100.0, 0.9, 90.0), walls(100.0, 0.7, 90.0)),
    ("0.8: allowed under 7.42 N/m", walls(100.0, 0.799072, 90.0), walls(7.41, 0.799072, 90.0)),
    ("under 6000 N/m", walls(6001.0, 0.05, 180.0) | {"axes": 1}, walls(5999.0, 0.05, 180.0)),  # sin 180° is 1.2e-16
    ("under 1200 N/m", walls(1210.0, 0.05, 90.0) | {"scale": (2.0, 1.0)}, walls(1190.0, 0.05, 90.0)),
    ("12000 N/m of wall 1 with", TWO | {"wall__stiffness": (1e3, 12e3)}, {"wall__stiffness": (5900.0, 5900.0)}),
    ("together", walls(3500.0, 0.05, 90.0, 90.0), walls(2700.0, 0.05, 90.0, 90.0)),
    ("allowed under 16000 N/m (6000 N/m with this coupling)", beside(30000.0), beside(5999.0)),
    (
        "wall.stiffness to under 6000 N/m or coupling.stiffness to under 1500 N/m",
        beside(6500.0),
        beside(6500.0, 1499.0),
    ),
    (
        "coupling.stiffness 2000 N/m with coupling.damping 2 N s/m needs b > 3 N s/m at T = 1 ms; "
        "the device has 3: allowed under 2000 N/m",
        SLOW | coupling(2000.0, 2.0),
        coupling(1999.0, 2.0),
    ),
    ("0.2 N s/m and cancellation.ratio 0.2 needs b > 1.11", STIFF | {CANCEL: 0.2}, coupling(3519.0, 0.2)),
    ("0.9 needs b > 1.67", STIFF | CANCELLED, coupling(310.0, 0.2) | {CANCEL: 0.7}),
    ("ratio 0.9 needs b > 0.852 N s/m, 0.1 ms late; the device has 0.8: at most 0.845", ALONE, {CANCEL: 0.845}),
    ("under 6400 N/m", walls(6410.0, 0.0, 90.0) | CANCELLED, walls(6390.0, 0.0, 90.0)),
    ("0.1 ms late", walls(4500.0, 0.05, 90.0) | {"late": 0.1e-3}, {"late": 0.0}),
    ("allowed at no stiffness", walls(12000.0, 0.81, 90.0) | {"late": 1e-3}, walls(0.0, 0.0, 90.0)),
    (", or more with a shorter delay", walls(12000.0, 0.79, 90.0) | {"late": 1e-3}, walls(0.0, 0.0, 90.0)),
]


@pytest.mark.parametrize("told, refused, taken", REFUSED)
def test_a_refusal_names_the_gain_and_what_it_names_as_the_most_is_taken(told, refused, taken):
    assert told in refusal(**refused)
    assert refusal(**refused | taken) == ""


@pytest.mark.parametrize("late", [0.0, 1e-4, 5e-4])
def test_the_most_that_a_refusal_names_is_the_bound_with_cancellation_before_it_however_late_the_writes(late):
    def refused(stiffness):
        return refusal(late, **SLOW | walls(stiffness, 0.1, 0.0) | {CANCEL: 0.7})

    most = float(re.search(r"the device has 3: allowed under (\d+) N/m", refused(90000.0))[1])
    assert refused(0.999 * most) == "" and refused(1.01 * most)


def test_the_most_that_a_refusal_of_oblique_walls_names_is_the_bound_of_both():
    most = float(re.search(r"lower wall\.stiffness to under (\d+) N/m$", refusal(**walls(4000.0, 0.0, *OBLIQUE)))[1])
    assert refusal(**walls(most - 1.0, 0.0, *OBLIQUE)) == ""
    assert refusal(**walls(most + 1.0, 0.0, *OBLIQUE)) != ""


def test_the_margin_is_the_device_s_damping_less_what_counts_in_the_worst_direction():
    for margin, gains in (
        (0.4, NO_COUPLING | {CANCEL: 0.5, "scale": (0.5, 1.0)}),
        (0.4, NO_COUPLING | {CANCEL: 0.5, "scale": (1.0, 2.0)}),
        (0.8 - 0.5 * (np.cos(np.radians(30.0)) + 0.5) ** 2, walls(4000.0, 0.0, *OBLIQUE)),
        (0.8 - 0.25 - 0.2, coupling(2000.0, 0.2)),
        (0.8 - 0.25 - 0.2 - 0.9 * 0.8, coupling(2000.0, 0.2, cancellation__ratio=0.9)),
        (0.8 - 0.375 - 0.2, walls(3000.0, 0.2, 90.0)),
        (0.8 - 0.375 - 0.2, walls(3000.0, 0.2, 90.0) | ADAPTIVE | {CANCEL: 0.5, "cancellation__band": 1e-4}),
    ):
        assert gain_check.margins(settings(**gains), 0.0)[1] == pytest.approx(margin), gains


def test_gains_are_softer_only_if_they_need_no_more_in_any_direction():
    beyond, less = (settings(**walls(stiffness, 0.05, 0.0)) for stiffness in (12000.0, 11000.0))
    both = settings(**walls(12000.0, 0.05, 0.0, 90.0))
    assert gain_check.softer(beyond, beyond, 0.0) and gain_check.softer(less, beyond, 0.0)
    assert gain_check.margins(both, 0.0)[1] == pytest.approx(gain_check.margins(beyond, 0.0)[1])
    assert not gain_check.softer(both, beyond, 0.0) and gain_check.softer(beyond, both, 0.0)


def test_where_gains_would_fit_in_time_the_shortfall_blames_the_lateness_and_says_the_most_that_they_leave():
    wall = settings(**walls(4500.0, 0.05, 90.0))
    most = gain_check.most_lateness(wall, 1e-3)
    assert gain_check.margins(wall, 0.999 * most)[1] > 0.0 >= gain_check.margins(wall, 1.001 * most)[1]
    assert shortfall(wall, 0.999 * most) == ""
    assert shortfall(wall, 1e-3) == (
        "forces act 1 ms late (99 % of the writes within 1 ms, the device's delays 0 ms), and these gains leave at "
        f"most {most * 1e3:.3g} ms: lower them, or see haptic doctor"
    )


def test_where_gains_fit_at_no_lateness_the_shortfall_blames_the_gain():
    for gains, told in (
        (walls(12000.0, 0.05, 90.0), "wall.stiffness 12000 N/m with"),
        (coupling(9000.0, 0.1), "coupling.stiffness 9000 N/m with"),
        (coupling(1000.0, 0.5, coupling__rotational_stiffness=900.0), "coupling.rotational_stiffness 900 N m/rad with"),
        (NO_COUPLING | {CANCEL: 1.0}, "cancellation.ratio 1 needs"),
    ):
        assert shortfall(settings(axes=3, **gains), 1e-4).startswith(told)


@pytest.mark.parametrize("link, write", [(None, None), (0.9e-3, np.nan), (1e-3, 0.2e-3), (1.1e-3, 0.2e-3)])
def test_forces_are_late_by_the_longer_of_described_and_measured_delay_and_by_the_writes(link, write):
    hardware = None if link is None else SimpleNamespace(delay=lambda: link)
    telemetry = None if write is None else SimpleNamespace(percentiles=lambda: np.full((4, 4), write))
    described = SimpleNamespace(sensing_delay=0.4e-3, actuation_delay=0.6e-3, stamp_error=0.0)
    driver = SimpleNamespace(device=described, hardware=hardware, telemetry=telemetry)
    late = DriverNode.lateness(driver)
    assert late == pytest.approx((1.1e-3 if link == 1.1e-3 else 1e-3) + (0.2e-3 if write == 0.2e-3 else 0.0), rel=1e-12)


def test_books_follow_a_links_delay_that_is_longer_than_described_and_small_changes_wait():
    described = SimpleNamespace(sensing_delay=0.0, actuation_delay=50e-6, stamp_error=0.0)
    told = iter([0.0, 60e-6, 75e-6, 100e-6, 1.0])
    hardware = SimpleNamespace(delay=lambda: next(told))
    driver = SimpleNamespace(device=described, hardware=hardware, _delay=50e-6, _version=3)
    driver.values = values("haptic_driver", servo__rate=1000.0)
    put = [controller_config.settings_from(device(0.8), driver.values, driver._version)]
    driver.settings, driver._set = lambda: put[-1].copy(), lambda settings, judged: put.append(judged.into(settings))
    driver.lateness = lambda: driver._delay
    for _ in range(5):
        DriverNode._follow_margin(driver)
    most = controller_config.MOST_LATE / 1000.0
    followed = [(float(one["hardware"]["delay"][0]), int(one["version"][0])) for one in put[3:]]
    assert followed == [(0.0, 3), (100e-6, 4), (most, 5)] and (driver._delay, driver._version) == followed[-1]
    assert [float(one["passivity"]["lateness"][0]) for one in put[1:]] == [50e-6, 50e-6, 50e-6, 100e-6, most]


@given(st.floats(1.0, 1e5), st.floats(-5.0, 5.0), st.floats(0.0, 1.0), st.integers(0, 6))
def test_the_law_is_the_closed_form_of_whole_periods_and_of_a_damper_and_little_above_that_of_a_late_spring(
    stiffness, damping, late, samples
):
    period = 1e-3

    def law(spring, viscous, most, least=0.0):
        return passivity.least_damping(spring, viscous, period, most * period, least * period)

    assert law(stiffness, damping, 0.0) == pytest.approx(closed_forms.wall_damping(stiffness, damping, period))
    assert law(0.0, damping, late) == pytest.approx(abs(damping) * np.sqrt(1.0 + late))
    spring = closed_forms.fractionally_delayed_spring_damping(stiffness, period, late)
    assert (1.0 - 1e-12) * spring <= law(stiffness, 0.0, late) <= 1.012 * spring
    always = (samples + 0.5) * period * stiffness
    assert law(stiffness, damping, samples, samples) == pytest.approx(always + abs(damping))
    needed = closed_forms.delayed_wall_damping(stiffness, abs(damping), period, samples)
    assert law(stiffness, damping, samples) >= needed * (1.0 - 1e-12)
    both = law(stiffness, damping, late)
    assert both >= (1.0 - 1e-12) * closed_forms.late_write_damping(stiffness, damping, period, 0.5 * late * period)
    assert both <= 1.001 * (0.5 + np.sqrt(late)) * period * stiffness + abs(damping) * np.sqrt(1.0 + late)
