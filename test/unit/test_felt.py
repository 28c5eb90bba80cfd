# SPDX-License-Identifier: Apache-2.0
"""What is read off a motion: the impedance felt, an oscillation, contacts; against data whose truth is known."""

import math

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from haptic_device.theory.probe import GroundTruth, apparent_damping
from haptic_display.run.report.impedance import fit
from haptic_display.run.report.oscillation import LEAST_FORCE, spectrum_of
from haptic_display.run.report.wall_contacts import contacts, touching

MASS, DAMPING, STIFFNESS = 0.1, 4.0, 1500.0


def motion(rng, seconds=20.0, step=0.002):
    """A hand's wandering: eight sines below 8 Hz, some millimetres; time, position, velocity, acceleration."""
    time = np.arange(0.0, seconds, step)
    size, omega = rng.uniform(0.2, 1.0, 8) * 5e-3, 2 * np.pi * rng.uniform(0.3, 8.0, 8)
    phase = omega * time[:, None] + rng.uniform(0, 6, 8)
    return time, np.sin(phase) @ size, np.cos(phase) @ (size * omega), -np.sin(phase) @ (size * omega**2)


def pushed(rng, noise=0.15, **given):
    """The same with the force of a known impedance, under noise whose neighbours err alike."""
    time, x, v, a = motion(rng, **given)
    err = lfilter([noise], [1, -0.95], rng.normal(size=len(time)) * 0.05)
    return time, x, v, MASS * a + DAMPING * v + STIFFNESS * x + 2.0 + err


def test_stiffness_and_damping_are_found_within_a_percent():
    for seed in range(4):
        found = fit(*pushed(np.random.default_rng(seed)))
        assert found.stiffness.value == pytest.approx(STIFFNESS, rel=0.01)
        assert found.damping.value == pytest.approx(DAMPING, rel=0.01)
        assert found.explained > 0.999


@pytest.mark.parametrize(("seconds", "alike"), [(20.0, 0.04), (20.0, 1.0), (1.5, 0.04)])
def test_the_confidence_holds_the_truth_as_often_as_it_says_however_long_errors_stay_alike(seconds, alike):
    """Both sides: the truth is inside often enough, and the interval is no wider than twice what it has to be."""
    truth, found, keep = np.array([MASS, DAMPING, STIFFNESS]), [], np.exp(-0.002 / alike)
    for seed in range(120):
        time, x, v, a = motion(rng := np.random.default_rng(1000 + seed), seconds)
        err = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.normal(size=len(time)) * 0.05)
        found.append(fit(time, x, v, MASS * a + DAMPING * v + STIFFNESS * x + 2.0 + err)[:3])
    values, widths = np.array(found).transpose(2, 0, 1)
    held = (abs(values - truth) <= widths).mean(axis=0)
    assert (held >= 0.87).all()  # 95 % less four sigma of 120 draws
    assert (np.median(widths, axis=0) < 2.0 * 1.96 * values.std(axis=0)).all()


def shaken_by_the_display(rng, seconds=10.0, step=0.002, sub_steps=4):
    """A hand's spring moves a device under a display of known mass and damping, whose own noise of 1 N shakes it."""
    device, own_damping, hand, grip = 0.1, 3.0, 300.0, 5.0
    time, *target = motion(rng, seconds, step)
    noise = np.repeat(rng.normal(size=(len(time), 1)), sub_steps, axis=1)
    x, v, means = 0.0, 0.0, np.empty((len(time), 3))
    for row, (want, rate, _), pushes in zip(means, np.transpose(target), noise, strict=True):
        row[:] = 0.0
        for push in pushes:
            pull = hand * (want - x) + grip * (rate - v)
            a = (pull - (own_damping + DAMPING) * v - push) / (device + MASS)
            row += np.array([x, v, MASS * a + DAMPING * v + push]) / sub_steps
            v += a * step / sub_steps
            x += v * step / sub_steps
    return time, *means.T


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_the_display_that_shakes_the_handle_is_hardly_taken_for_a_mass(seed):
    time, x, v, force = shaken_by_the_display(np.random.default_rng(seed))
    found, columns = fit(time, x, v, force), np.stack([np.gradient(v, time), v, x], axis=1)
    plain = np.linalg.lstsq(columns - columns.mean(axis=0), force - force.mean(), rcond=None)[0]
    assert plain[0] < 0.5 * MASS < found.mass.value < MASS + found.mass.error
    assert found.damping.value == pytest.approx(DAMPING, abs=1.5 * found.damping.error)


def test_each_contact_has_its_own_resting_place_and_one_stiffness():
    rng = np.random.default_rng(1)
    time, x, v, force = pushed(rng)
    groups = (time // 5.0).astype(int)
    found = fit(time, x, v, force + 30.0 * groups, groups)
    assert found.stiffness.value == pytest.approx(STIFFNESS, rel=0.01)


def test_a_handle_that_stood_still_or_data_without_numbers_have_no_impedance():
    time, x, v, force = pushed(np.random.default_rng(1))
    assert fit(time, 0 * x, 0 * v, force) is None
    assert fit(time, x, v, np.full_like(force, np.nan)) is None
    assert fit(time[:90], x[:90], v[:90], force[:90]) is None
    half = np.where(time < 10.0, force, np.nan)
    assert fit(time, x, v, half).stiffness.value == pytest.approx(STIFFNESS, rel=0.02)


def noisy(rng, seconds=20.0, rate=4000.0):
    """A hand's slow force and the noise of quantized forces, two axes."""
    count = int(seconds * rate)
    return np.cumsum(rng.normal(size=(count, 2)) * 1e-3, axis=0) + rng.normal(size=(count, 2)) * 0.01


@few(8)
@given(frequency=st.floats(25.0, 1500.0), force=st.floats(0.1, 5.0), begin=st.floats(1.0, 12.0))
def test_an_oscillation_is_named_with_its_frequency_force_and_time(frequency, force, begin):
    rate, data = 4000.0, noisy(np.random.default_rng(7))
    during = slice(int(begin * rate), int((begin + 3.0) * rate))
    time = np.arange(during.stop - during.start) / rate
    data[during, 1] += np.sqrt(2.0) * force * np.sin(2 * np.pi * frequency * time)
    found = spectrum_of(data, rate).oscillation
    assert found.frequency == pytest.approx(frequency, abs=1.0)
    assert found.force == pytest.approx(force, rel=0.1)
    assert abs(found.begin - begin) <= 0.5 and found.seconds == pytest.approx(3.0, abs=0.8)


def test_noise_a_hand_and_steps_of_contact_are_no_oscillation():
    for seed in range(5):
        rng = np.random.default_rng(seed)
        data = noisy(rng)
        for begin in rng.integers(0, len(data), 12):
            data[begin : begin + 2000, 0] += 3.0
        assert spectrum_of(data, 4000.0).oscillation is None


def test_a_line_too_weak_to_be_felt_and_the_stair_of_the_exchange_are_no_oscillation():
    time = np.arange(0.0, 10.0, 1 / 4000.0)
    for factor, there in ((0.7, False), (1.5, True)):
        line = np.sqrt(2.0) * factor * LEAST_FORCE * np.sin(2 * np.pi * 60.0 * time)
        force = np.stack([line, 0 * time], axis=1) + np.random.default_rng(1).normal(size=(len(time), 2)) * 1e-4
        assert (spectrum_of(force, 4000.0).oscillation is not None) is there
    stair = np.stack([0.5 * np.sin(2 * np.pi * 998.5 * time), 0 * time], axis=1)
    assert spectrum_of(stair, 4000.0).oscillation and spectrum_of(stair, 4000.0, 1000.0).oscillation is None


def test_what_has_no_spectrum_is_refused_in_a_sentence_and_a_few_samples_have_no_impedance():
    for shape, rate, sentence in (
        ((4000, 0), 1000.0, "a force of shape (4000, 0) has no spectrum; (samples, axes) is needed"),
        ((4000,), 1000.0, "a force of shape (4000,) has no spectrum"),
        ((1, 2), 1.0, "rate is 1 Hz"),
        ((400, 2), math.nan, "rate is nan Hz"),
        ((0, 2), 1000.0, "a force of 0 s is too short for a spectrum"),
        ((1, 2), 1000.0, "a force of 0.001 s is too short for a spectrum"),
    ):
        with pytest.raises(ValueError) as refusal:
            spectrum_of(np.zeros(shape), rate)
        assert str(refusal.value).startswith(sentence)
    for count in range(4):
        none = np.zeros(count)
        assert fit(none, none, none, none) is None
        with pytest.raises(ValueError, match="the truth came|the handle hardly moved"):
            apparent_damping(GroundTruth(*[none] * 5), 0.0)


def test_contacts_begin_and_end_where_they_do_and_a_bounce_is_one():
    time = np.arange(0.0, 1.0, 0.001)
    touch = (time > 0.2) & (time < 0.3) | (time > 0.305) & (time < 0.4) | (time > 0.7005) & (time < 0.9)
    touch |= time == 0.55  # one tick alone is none
    force = np.stack([time, 0 * time], axis=1)
    found = contacts(time, touch, force)
    assert [(round(c.begin, 3), round(c.end, 3)) for c in found] == [(0.201, 0.399), (0.701, 0.899)]
    assert found[1].force == pytest.approx(0.899)


def test_a_wall_at_the_handle_and_the_tool_in_the_scene_both_count_as_contact():
    rows = np.zeros(3, [("tool_contact", "f8"), ("force_walls", "f8", (3,))])
    rows["tool_contact"][0], rows["force_walls"][1, 1] = 1.0, -0.5
    assert touching(rows).tolist() == [True, True, False]
