# SPDX-License-Identifier: Apache-2.0
"""Identification: a device shaken in lock-step is recognized, with a confidence that holds, or a sentence says why."""

import functools

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from haptic_device import operating
from haptic_device.analysis.excitation import shakes
from haptic_device.analysis.identify import NAMES, Trace, identify, resolution_of, trace_of
from haptic_device.device import Axis, Device, load_device, plant_of
from haptic_device.law import engage, operator, plant, servo
from haptic_device.runtime import loop
from haptic_sim.cli.identify import identify as command
from haptic_sim.cli.identify import write


def axis(mass, damping, coulomb, step, sign=1):
    return Axis(
        name="x", counts_per_unit=1.0 / step, motor_limit=15.0, workspace=(-0.12, 0.12), velocity_limit=3.0,
        mass=mass, damping=damping, coulomb=coulomb, encoder_sign=sign, motor_sign=sign,
    )  # fmt: skip


@functools.cache
def shaken(mass=0.1, damping=3.0, coulomb=0.02, step=5e-6, rate=2000.0, sensing=0.0, acting=0.0, sign=1, force=3.0):
    """Rows of a servo that shakes a device and believes it to be another one, 0.05 kg and 1 N s/m; write 30 µs late."""
    true = Device(
        name="true", axes=(axis(mass, damping, coulomb, step, sign),), sensing_delay=sensing, actuation_delay=acting
    )
    told = Device(name="told", axes=(axis(0.05, 1.0, 0.0, step, sign),))
    values = {p.name: p.default for p in operating.PARAMETERS}
    values |= {"servo.rate": rate, "coupling.stiffness": 0.0, "coupling.damping": 0.0}
    memory = np.zeros(1, servo.MEMORY).view(np.recarray)
    memory.state, memory.engage = engage.ENGAGED, 1.0
    body, state = plant_of(true).view(np.recarray), np.zeros(1, plant.PLANT_MEMORY).view(np.recarray)
    motion = operator.script({p.name: p.default for p in operator.PARAMETERS}).view(np.recarray)
    tool, blocks, first = np.zeros(1, loop.TOOL).view(np.recarray), [], 0
    period, plan = round(1e9 / rate), shakes((0.0,), force, 1.0, 1.0 / rate)
    while first < 3.0 * rate:
        shake = next(plan)
        values |= {f"wall.{name}": getattr(shake, name) for name in ("normals", "offsets", "stiffness", "damping")}
        settings, rows = operating.settings_from(told, values).view(np.recarray), round(shake.seconds * rate)
        rows = np.zeros(rows, servo.TICK).view(np.recarray)
        at = (first * period, first, 30_000, engage.ENABLE)
        loop.run_lockstep(settings, memory, rows, tool, body, state, motion, *at)
        blocks.append(np.asarray(rows))
        first += len(rows)
    return np.concatenate(blocks)


def found(step=5e-6, sign=1, **device):
    return identify(trace_of(shaken(step=step, sign=sign, **device), 0, sign * step), 0.05, 1.0)


@pytest.mark.parametrize(
    "device",
    [
        {},
        {"mass": 0.25, "damping": 0.6, "coulomb": 0.1},
        {"coulomb": 0.0, "damping": 8.0},
        {"sensing": 2e-4, "acting": 1.3e-4},
        {"step": 5e-5, "rate": 1000.0, "sign": -1},
    ],
)
def test_a_device_is_recognized_by_values_the_servo_was_not_told(device):
    true = {"mass": 0.1, "damping": 3.0, "coulomb": 0.02, "bias": 0.0, **device}
    true["delay"] = device.get("sensing", 0.0) + device.get("acting", 0.0)
    identified = found(**device)
    for name in NAMES:
        estimate = getattr(identified, name)
        assert abs(estimate.value - true[name]) <= 3.0 * estimate.confidence + 1e-9
    assert identified.mass.confidence < 1e-3 * true["mass"]
    assert identified.damping.confidence < 5e-3 * true["damping"]
    assert identified.coulomb.confidence < 1e-3
    assert identified.delay.confidence < 2e-5
    assert identified.residual == pytest.approx(device.get("step", 5e-6) / np.sqrt(12.0), rel=0.1)


def test_a_weaker_shake_leaves_a_wider_confidence():
    assert found(force=0.5).mass.confidence > 2.0 * found().mass.confidence


def test_a_constant_force_is_told_from_friction():
    trace = trace_of(shaken(), 0, 5e-6)
    pulled = identify(trace._replace(force=trace.force - 0.2), 0.1, 3.0)
    assert pulled.bias.value == pytest.approx(0.2, abs=1e-3)
    assert pulled.coulomb.value == pytest.approx(0.02, abs=1e-3)


@pytest.mark.parametrize("every", [1, 4])
def test_the_encoder_step_is_what_all_changes_of_the_counts_are_made_of(every):
    counts = every * np.array([0, 1, 1, 3, 2, -7])
    assert resolution_of(counts, -1e-5) == pytest.approx(every * 1e-5)


def test_a_trace_that_tells_nothing_is_refused_in_a_sentence():
    time = np.arange(4000) * 1e-3
    still = Trace(time, time, np.zeros(4000), np.zeros(4000))
    with pytest.raises(ValueError, match="the motor force never changed"):
        identify(still, 0.1, 1.0)
    with pytest.raises(ValueError, match="the handle never moved"):
        identify(still._replace(force=np.sin(time)), 0.1, 1.0)
    with pytest.raises(ValueError, match="the trace lasts 0.5 s; 1.6 s are the least"):
        identify(Trace(*(column[:501] for column in still)), 0.1, 1.0)
    with pytest.raises(ValueError, match="the counts never changed"):
        resolution_of(np.zeros(9), 1e-5)


def test_a_trace_with_gaps_is_refused():
    rows = shaken()
    with pytest.raises(ValueError, match="has gaps; every tick is needed"):
        trace_of(np.concatenate([rows[:100], rows[101:]]), 0, 5e-6)


def test_the_description_that_is_written_can_be_loaded_and_keeps_what_was_not_found(tmp_path):
    described = load_device("desktop")
    values = {"mass": (0.2, 1e-3), "damping": (1.5, 0.02), "coulomb": (0.04, 1e-3), "bias": (0.0, 1e-3)}
    values |= {"delay": (4e-4, 1e-5), "resolution": (5e-6, None), "residual": (2e-6, None)}
    write(tmp_path / "found.yaml", described, {"x": values, "y": values})
    device = load_device(str(tmp_path / "found.yaml"))
    assert (device.axes[0].mass, device.axes[1].damping, device.axes[1].coulomb) == (0.2, 1.5, 0.04)
    assert device.axes[2] == described.axes[2]
    assert device.sensing_delay + device.actuation_delay == 4e-4
    text = (tmp_path / "found.yaml").read_text()
    assert "mass 0.2 ± 0.001 kg" in text
    assert "Not shaken, as described: theta" in text


@pytest.mark.parametrize(
    "words, sentence",
    [
        (("--force", "0"), "force is 0 N, but it must be a finite number greater than 0"),
        (("--force", "90"), "force is 90 N, but the motor of axis x gives at most 15 N"),
        (("--device", "nowhere"), "nowhere"),
    ],
)
def test_bad_input_ends_in_one_sentence_and_exit_code_2(words, sentence):
    app = typer.Typer()
    app.command()(command)
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
