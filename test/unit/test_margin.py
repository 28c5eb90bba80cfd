# SPDX-License-Identifier: Apache-2.0
"""The passivity margin of an operating point, and the refusal of gains beyond it."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lockstep_systems import device, values

from adversary.switching import switched_cancellation_damping
from haptic_device import controller_config, gain_check
from haptic_device.control import passivity, velocity_estimator
from haptic_device.nodes.driver import DriverNode
from reference import closed_forms

TURNED = "coupling.rotational_stiffness 900 N m/rad with"
NO_COUPLING = {"coupling__stiffness": 0.0, "coupling__damping": 0.0}


def settings(physical_damping=0.8, scale=(1.0, 1.0), **driver):
    return controller_config.settings_from(device(physical_damping, scale=scale), values("haptic_driver", **driver))[0]


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


def test_refusal_names_the_wall_its_need_what_the_device_has_and_the_largest_stiffness():
    assert gain_check.refusal(settings(**walls(12000.0, 0.05, 90.0))) == (
        "wall.stiffness 12000 N/m with damping 0.05 N s/m needs b > 1.55 N s/m at T = 0.25 ms; "
        "the device has 0.8: allowed under 6000 N/m"
    )


def test_a_refusal_never_reads_as_if_the_gains_fitted():
    beyond = gain_check.refusal(settings(**walls(6000.5, 0.05, 90.0)))
    assert "needs b > 0.8001 N s/m" in beyond and beyond.endswith("the device has 0.8: allowed under 6000 N/m")
    slow = {"servo__rate": 1000.0, "coupling__damping": 2.0}
    assert gain_check.refusal(settings(3.0, **slow, coupling__stiffness=1999.0)) == ""
    assert gain_check.refusal(settings(3.0, **slow, coupling__stiffness=2000.0)) == (
        "coupling.stiffness 2000 N/m with coupling.damping 2 N s/m needs b > 3 N s/m at T = 1 ms; "
        "the device has 3: allowed under 2000 N/m"
    )


@pytest.mark.parametrize(("damping", "allowed"), [(0.9, "at no stiffness"), (0.799072, "under 7.42 N/m")])
def test_where_damping_leaves_little_the_allowed_stiffness_is_not_rounded_to_none(damping, allowed):
    assert gain_check.refusal(settings(**walls(100.0, damping, 90.0))).endswith(
        f"the device has 0.8: allowed {allowed}"
    )


def test_a_wall_that_leans_by_rounding_towards_an_axis_that_is_not_there_is_refused_as_one_that_does_not():
    lean = values("haptic_driver", **walls(12000.0, 0.05, 180.0))  # sin 180° is 1.2e-16 here
    assert gain_check.refusal(controller_config.settings_from(device(0.8, axes=1), lean)[0]).endswith(
        "the device has 0.8: allowed under 6000 N/m"
    )


def test_gains_just_within_the_damping_are_taken_and_just_beyond_refused():
    for angle in (0.0, 30.0, 90.0, 200.0):
        assert gain_check.refusal(settings(**walls(5999.0, 0.05, angle))) == ""
        assert gain_check.refusal(settings(**walls(6001.0, 0.05, angle))) != ""


def test_two_walls_of_one_direction_add_up_and_square_ones_do_not():
    assert gain_check.refusal(settings(**walls(3500.0, 0.05, 90.0, 90.0))) != ""
    assert gain_check.refusal(settings(**walls(2700.0, 0.05, 90.0, 90.0))) == ""
    assert gain_check.refusal(settings(**walls(5900.0, 0.05, 0.0, 90.0))) == ""


def test_what_is_cancelled_counts_where_the_device_has_its_damping_and_with_no_tool_too():
    for scale in (0.5, 1.0, 2.0):
        cancelled = settings(scale=(scale, scale), cancellation__ratio=0.5, **NO_COUPLING)
        assert gain_check.margins(cancelled, 0.0)[0][0] == pytest.approx(0.8 * 0.5)
    windows = {"velocity__estimator": "adaptive_window", "velocity__window": 8, "coupling__stiffness": 0.0}
    assert "cancellation.ratio 0.9 (twice" in gain_check.refusal(
        settings(coupling__damping=0.35, cancellation__ratio=0.9, **windows)
    )


def test_gains_are_softer_only_if_they_need_no_more_in_any_direction():
    beyond = settings(**walls(12000.0, 0.05, 0.0))
    less = settings(**walls(11000.0, 0.05, 0.0))
    assert gain_check.softer(beyond, beyond, 0.0) and gain_check.softer(less, beyond, 0.0)
    both = settings(**walls(12000.0, 0.05, 0.0, 90.0))
    assert gain_check.margins(both, 0.0)[1] == pytest.approx(gain_check.margins(beyond, 0.0)[1])
    assert not gain_check.softer(both, beyond, 0.0) and gain_check.softer(beyond, both, 0.0)


def test_the_worst_direction_of_oblique_walls_counts():
    oblique = settings(**walls(4000.0, 0.0, 30.0, 60.0))
    expected = 0.8 - 0.5 * (1.0 + np.cos(np.radians(30.0)))
    assert gain_check.margins(oblique, 0.0)[1] == pytest.approx(expected)
    assert "together" in gain_check.refusal(oblique)


def beside_a_coupling(stiffness, coupling=2000.0):
    gains = {"coupling__stiffness": coupling, "coupling__damping": 1.0}
    return gain_check.refusal(settings(3.0, **walls(stiffness, 1.0, 0.0) | gains))


def test_a_wall_beyond_what_it_may_alone_is_told_at_once_what_it_may_with_the_coupling():
    refused = beside_a_coupling(30000.0)
    assert refused.endswith("the device has 3: allowed under 16000 N/m (6000 N/m with this coupling)")
    assert beside_a_coupling(5999.0) == "" and beside_a_coupling(6001.0) != ""


def test_walls_and_coupling_that_are_too_much_together_are_told_how_far_to_lower_either():
    refused = beside_a_coupling(6500.0)
    assert refused.endswith("lower wall.stiffness to under 6000 N/m or coupling.stiffness to under 1500 N/m")
    assert beside_a_coupling(6500.0, 1499.0) == "" and beside_a_coupling(6500.0, 1501.0) != ""
    oblique = gain_check.refusal(settings(**walls(4000.0, 0.0, 30.0, 60.0)))
    most = float(re.search(r"lower wall\.stiffness to under (\d+) N/m$", oblique)[1])
    assert gain_check.refusal(settings(**walls(most - 1.0, 0.0, 30.0, 60.0))) == ""
    assert gain_check.refusal(settings(**walls(most + 1.0, 0.0, 30.0, 60.0))) != ""


def test_scaling_changes_the_felt_stiffness_by_its_square():
    assert gain_check.refusal(settings(scale=(2.0, 1.0), **walls(1190.0, 0.05, 90.0))) == ""
    assert "under 1200 " in gain_check.refusal(settings(scale=(2.0, 1.0), **walls(1210.0, 0.05, 90.0)))


def test_of_several_walls_the_refusal_names_the_one_that_is_too_stiff():
    mixed = walls(1000.0, 0.05, 0.0, 90.0) | {"wall__stiffness": (1000.0, 12000.0)}
    assert gain_check.refusal(settings(**mixed)).startswith("wall.stiffness 12000 N/m of wall 1 with damping 0.05")


def test_where_gains_would_fit_in_time_the_shortfall_blames_the_lateness_and_says_the_most_that_they_leave():
    wall = settings(**walls(4500.0, 0.05, 90.0))
    most = gain_check.most_lateness(wall, 1e-3)
    assert gain_check.margins(wall, 0.999 * most)[1] > 0.0 >= gain_check.margins(wall, 1.001 * most)[1]
    assert gain_check.shortfall(wall, 0.999 * most) == ""
    assert gain_check.shortfall(wall, 1e-3) == (
        "forces act 1 ms late (99 % of the writes within 1 ms, the device's delays 0 ms), and these gains leave at "
        f"most {most * 1e3:.3g} ms: lower them, or see haptic doctor"
    )


@pytest.mark.parametrize(
    ("gains", "told"),
    [
        (walls(12000.0, 0.05, 90.0), "wall.stiffness 12000 N/m with"),
        ({"coupling__stiffness": 9000.0, "coupling__damping": 0.1}, "coupling.stiffness 9000 N/m with"),
        ({"coupling__stiffness": 1000.0, "coupling__damping": 0.5, "coupling__rotational_stiffness": 900.0}, TURNED),
        (
            {"cancellation__ratio": 0.9, "velocity__estimator": "adaptive_window", **NO_COUPLING},
            "cancellation.ratio 0.9 (twice, for adaptive_window) needs",
        ),
    ],
)
def test_where_gains_fit_at_no_lateness_the_shortfall_blames_the_gain(gains, told):
    wanted = controller_config.settings_from(device(0.8, axes=3), values("haptic_driver", **gains))[0]
    assert gain_check.shortfall(wanted, 1e-4).startswith(told)


@pytest.mark.parametrize("link", [None, 0.0, 0.9e-3, 1e-3, 1.1e-3])
@pytest.mark.parametrize("write", [None, np.nan, 0.2e-3])
def test_forces_are_late_by_the_longer_of_described_and_measured_delay_and_by_the_writes(link, write):
    hardware = None if link is None else SimpleNamespace(delay=lambda: link)
    telemetry = None if write is None else SimpleNamespace(percentiles=lambda: np.full((4, 4), write))
    described = SimpleNamespace(sensing_delay=0.4e-3, actuation_delay=0.6e-3)
    driver = SimpleNamespace(device=described, hardware=hardware, telemetry=telemetry)
    late = DriverNode.lateness(driver)
    assert late == pytest.approx((1.1e-3 if link == 1.1e-3 else 1e-3) + (0.2e-3 if write == 0.2e-3 else 0.0), rel=1e-12)


def test_lateness_costs_stiffness():
    wall = settings(**walls(4500.0, 0.05, 90.0))
    assert gain_check.margins(wall, 0.0)[1] > 0.0 > gain_check.margins(wall, 0.1e-3)[1]
    assert "0.1 ms late" in gain_check.refusal(wall, 0.1e-3)


def test_cancellation_of_a_held_coupling_counts_where_it_outweighs_the_couplings_own_damping():
    gains = {"coupling__stiffness": 2000.0, "coupling__damping": 0.2}
    assert gain_check.margins(settings(**gains), 0.0)[0][0] == pytest.approx(0.8 - 0.25 - 0.2)
    cancelled = gain_check.margins(settings(**gains, cancellation__ratio=0.9), 0.0)[0][0]
    assert cancelled == pytest.approx(0.8 - 0.25 - abs(0.2 - 0.9 * 0.8))


@pytest.mark.parametrize("ratio, told", [(0.2, ""), (0.9, " and cancellation.ratio 0.9")])
def test_refusal_of_a_coupling_names_its_damping_as_set_and_the_cancellation_where_that_is_what_counts(ratio, told):
    gains = {"coupling__stiffness": 6000.0, "coupling__damping": 0.2, "coupling__rotational_damping": 0.0}
    need = 0.75 + max(0.2, abs(0.2 - ratio * 0.8))
    assert gain_check.refusal(settings(**gains, cancellation__ratio=ratio)).startswith(
        f"coupling.stiffness 6000 N/m with coupling.damping 0.2 N s/m{told} needs b > {need:.4g} N s/m at T = 0.25 ms; "
    )


def test_late_cancellation_alone_is_refused_by_its_own_name_and_taken_at_what_the_sentence_allows():
    late = 0.1e-3  # of T = .25 ms: 0.9 b √1.4 > b
    refused = gain_check.refusal(settings(cancellation__ratio=0.9, **NO_COUPLING), late)
    assert refused == ("cancellation.ratio 0.9 needs b > 0.852 N s/m, 0.1 ms late; the device has 0.8: at most 0.845")
    assert gain_check.refusal(settings(cancellation__ratio=0.845, **NO_COUPLING), late) == ""
    assert gain_check.refusal(settings(cancellation__ratio=0.847, **NO_COUPLING), late) != ""


@pytest.mark.parametrize("ratio", [0.5, 0.9])
def test_walls_keep_their_whole_bound_where_cancellation_fades_out_over_a_ticks_travel(ratio):
    cancelled = {"cancellation__ratio": ratio, "cancellation__band": 0.005, "coupling__rotational_damping": 0.0}
    assert gain_check.refusal(settings(**walls(6390.0, 0.0, 30.0), **cancelled)) == ""
    assert "wall.stiffness" in gain_check.refusal(settings(**walls(6410.0, 0.0, 30.0), **cancelled))


@pytest.mark.parametrize("stiffness, damping", [(5900.0, 0.0), (5000.0, 0.1)])
def test_a_wall_pays_for_the_switch_where_the_band_is_narrower_than_a_ticks_travel(stiffness, damping):
    wall = {**walls(stiffness, damping, 90.0), "cancellation__ratio": 0.9, "coupling__rotational_damping": 0.0}
    travel = settings(**wall)["hardware"]["velocity_limit"][1] * 0.25e-3
    wide, narrow = (settings(**wall, cancellation__band=share * travel) for share in (1.01, 0.99))
    assert gain_check.margins(wide, 0.0)[1] == pytest.approx(0.8 - stiffness * 0.125e-3 - damping)
    needed = switched_cancellation_damping(stiffness, damping, 0.25e-3, 0.9)
    assert gain_check.margins(narrow, 0.0)[1] <= 0.8 - needed + 1e-12
    assert gain_check.refusal(wide) == ""
    assert "cancellation.band being narrower than a tick's travel" in gain_check.refusal(narrow)


def windowed_work(steps, windows):
    """Σ v̂_k Δ_{k+1} of a damper whose velocity is the mean of the last so many steps, from rest; T = 1."""
    rates = [np.sum(steps[max(0, k + 1 - window) : k + 1]) / window for k, window in enumerate(windows[:-1])]
    return float(np.dot(rates, steps[1:]))


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.integers(1, 32)), min_size=2, max_size=80))
def test_no_sequence_of_windows_draws_more_than_twice_the_dampers_own(pairs):
    steps, windows = (np.array(column) for column in zip(*pairs, strict=True))
    assert windowed_work(steps, windows) <= velocity_estimator.SWITCHED * steps @ steps + 1e-12


def test_switching_windows_draw_more_than_any_one_window_does():
    steps = 1.0 / np.sqrt(np.arange(1.0, 33.0))
    assert windowed_work(steps, np.arange(1, 33)) > 1.1 * steps @ steps
    for window in range(1, 33):
        assert windowed_work(steps, np.full(32, window)) <= steps @ steps


def test_the_adaptive_window_is_charged_twice_its_damping_and_a_window_of_one_tick_once():
    adaptive = {**walls(3000.0, 0.2, 90.0), "velocity__estimator": "adaptive_window"}
    assert gain_check.margins(settings(**adaptive), 0.0)[1] == pytest.approx(0.8 - 0.375 - 0.4)
    assert gain_check.margins(settings(**adaptive, velocity__window=1), 0.0)[1] == pytest.approx(0.8 - 0.375 - 0.2)
    adaptive["wall__damping"] = (0.22,)
    assert gain_check.refusal(settings(**adaptive)) == (
        "wall.stiffness 3000 N/m with damping 0.22 N s/m (twice, for adaptive_window) needs b > 0.815 N s/m at "
        "T = 0.25 ms; the device has 0.8: allowed under 2880 N/m"
    )


def test_with_adaptive_windows_no_more_than_half_of_the_damping_may_be_cancelled():
    free = {**NO_COUPLING, "coupling__rotational_damping": 0.0, "velocity__estimator": "adaptive_window"}
    assert gain_check.refusal(settings(**free, cancellation__ratio=0.49)) == ""
    assert "adaptive_window" in gain_check.refusal(settings(**free, cancellation__ratio=0.51))


@given(stiffness=st.floats(0.0, 1e5), damping=st.floats(-5.0, 5.0), period=st.floats(1e-4, 2e-3))
def test_without_delay_the_law_is_equation_3(stiffness, damping, period):
    expected = closed_forms.wall_damping(stiffness, damping, period)
    assert passivity.least_damping(stiffness, damping, period, 0.0) == pytest.approx(expected, rel=1e-12)


@given(stiffness=st.floats(1.0, 1e5), damping=st.floats(0.0, 5.0), late=st.floats(0.0, 0.5))
def test_for_late_writes_the_law_is_the_closed_form_of_the_analysis(stiffness, damping, late):
    expected = closed_forms.late_write_damping(stiffness, damping, 1e-3, late * 1e-3)
    assert passivity.least_damping(stiffness, damping, 1e-3, late * 1e-3) == pytest.approx(expected, rel=1e-9)


@given(stiffness=st.floats(1.0, 1e5), ratio=st.floats(0.0, 3.0), samples=st.integers(0, 6))
def test_for_whole_samples_of_delay_the_law_is_enough(stiffness, ratio, samples):
    period = 1e-3
    damping = ratio * stiffness * period
    needed = closed_forms.delayed_wall_damping(stiffness, damping, period, samples)
    assert passivity.least_damping(stiffness, damping, period, samples * period) >= needed * (1.0 - 1e-12)


def test_for_a_constant_fraction_of_delay_the_law_is_the_exact_need_of_a_spring():
    for late, needed in ((0.1, 0.6354), (0.25, 0.8080), (0.5, 1.0590), (0.75, 1.2864), (1.0, 1.5)):
        assert passivity.least_damping(1000.0, 0.0, 1e-3, late * 1e-3) == pytest.approx(needed, abs=5e-5)


@pytest.mark.parametrize("late", [0.0, 1e-4, 5e-4])
def test_the_most_that_a_refusal_names_is_taken_with_cancellation_before_it_however_late_the_writes(late):
    def refused(stiffness):
        given = walls(stiffness, 0.1, 0.0) | {"cancellation__ratio": 0.7, "cancellation__band": 0.02}
        return gain_check.refusal(settings(3.0, servo__rate=1000.0, **given), late)

    most = float(re.search(r"the device has 3: allowed under (\d+) N/m", refused(90000.0))[1])
    assert refused(0.999 * most) == "" and refused(1.01 * most)


def test_books_follow_a_links_delay_that_is_longer_than_described_and_small_changes_wait():
    described = SimpleNamespace(sensing_delay=0.0, actuation_delay=50e-6)
    told, put = iter([0.0, 60e-6, 75e-6, 100e-6, 1.0]), []
    hardware = SimpleNamespace(delay=lambda: next(told))
    driver = SimpleNamespace(device=described, hardware=hardware, _delay=50e-6, _version=3)
    driver.values, driver.servo = values("haptic_driver", servo__rate=1000.0), SimpleNamespace(set=put.append)
    driver._settings = lambda values, version: controller_config.settings_from(device(0.8), values, version)
    driver.lateness = lambda: driver._delay
    followed = []
    for _ in range(5):
        DriverNode._follow_delay(driver)
        followed.append((driver._delay, driver._version))
    assert followed == [(50e-6, 3), (50e-6, 3), (50e-6, 3), (100e-6, 4), (controller_config.MOST_LATE / 1000.0, 5)]
    assert [int(one["version"][0]) for one in put] == [4, 5]


@pytest.mark.parametrize(
    ("damping", "ending"), [(0.81, "allowed at no stiffness"), (0.79, ", or more with a shorter delay")]
)
def test_a_shorter_delay_is_advised_only_where_it_would_allow_more(damping, ending):
    assert gain_check.refusal(settings(**walls(12000.0, damping, 90.0)), 1e-3).endswith(ending)
