# SPDX-License-Identifier: Apache-2.0
"""Identification: a device shaken in lock-step is recognized, with a confidence that holds, or a sentence says why."""

import functools

import numpy as np
import pytest

from haptic_device.config.description import Axis, Device, load_device, parse
from haptic_device.config.parameter_types import defaults
from haptic_device.config.parameters import OPERATING_POINT, OPERATOR
from haptic_device.control import controller_config, enable_state, records
from haptic_device.device import loopback_config, operator_hand, plant, simulated_device
from haptic_device.realtime import servo_loop
from haptic_device.recording.status import Status
from haptic_device.theory.excitation import tool_twists, wall_jumps
from haptic_device.theory.identify import NAMES, Trace, identify, resolution_of, trace_of
from haptic_display.device_tools.excitation import unbroken
from haptic_display.device_tools.identification import _force, content_of, estimate, estimate_joint, write_description
from haptic_display.device_tools.tuning import refuse_other_device


def test_a_driver_of_another_device_is_refused_by_name_and_where_damping_is_described_by_that():
    for name, damping, described, ours in (
        ("desktop", "3, 3, 0.004", True, True),
        ("desktop", "3, 3, 0.003", True, False),
        ("desktop", "2", False, True),
        ("mine", "3, 3, 0.004", False, False),
    ):
        given = Status(0, 0, "", {"physical_damping": damping}, name), load_device("desktop"), described
        if ours:
            refuse_other_device(*given)
            continue
        with pytest.raises(ValueError) as refused:
            refuse_other_device(*given)
        assert str(refused.value) == (
            f"haptic_driver has the device {name}, physical damping {damping}, and --device is desktop, 3, 3, 0.004: "
            "give the description that the driver has"
        )


def axis(mass, damping, coulomb, step, sign=1):
    limits = {"motor_limit": 15.0, "workspace": (-0.12, 0.12), "velocity_limit": 3.0}
    signs = {"encoder_sign": sign, "motor_sign": sign}
    return Axis(name="x", counts_per_unit=1.0 / step, mass=mass, damping=damping, coulomb=coulomb, **limits, **signs)


class Servo:
    """In lock-step with a device, which it believes to be another one; its writes are 30 µs late."""

    def __init__(self, true, told, rate, values=None):
        self.told, self.rate, self.period, self.first, self.blocks = told, rate, round(1e9 / rate), 0, []
        self.values = defaults(OPERATING_POINT) | {"passivity.policy": "off", "servo.rate": rate}
        self.values |= {"coupling.stiffness": 0.0, "coupling.damping": 0.0} | (values or {})
        self.memory = np.zeros(1, records.STATE).view(np.recarray)
        self.memory.enable.state, self.memory.enable.ramp = enable_state.ENGAGED, 1.0
        self.body = loopback_config.plant_of(true).view(np.recarray)
        self.state = np.zeros(1, plant.PLANT_MEMORY).view(np.recarray)
        self.motion = operator_hand.script(defaults(OPERATOR)).view(np.recarray)
        self.tool = np.zeros(1, servo_loop.TOOL).view(np.recarray)

    def run(self, seconds, changes):
        """So long with these values changed."""
        self.values |= changes
        settings = controller_config.settings_from(self.told, self.values, self.first + 1).view(np.recarray)
        rows = np.zeros(round(seconds * self.rate), records.TRACE_ROW).view(np.recarray)
        at = (self.first * self.period, self.first, 30_000, enable_state.ENABLE)
        own = self.memory, rows, self.tool, self.body, self.state, self.motion
        simulated_device.run_lockstep(settings, *own, *at)
        self.blocks.append(np.asarray(rows))
        self.first += len(rows)

    def shake(self, plan):
        """Rows of 3 s and more of these shakes."""
        while self.first < 3.0 * self.rate:
            shake = next(plan)
            walls = {f"wall.{name}": getattr(shake, name) for name in ("normals", "offsets", "stiffness", "damping")}
            self.run(shake.seconds, walls)
        return np.concatenate(self.blocks)


@functools.cache
def shaken(mass=0.1, damping=3.0, coulomb=0.02, step=5e-6, rate=2000.0, sensing=0.0, acting=0.0, sign=1, force=3.0):
    """Rows of a servo that shakes a device and believes it to be another one, 0.05 kg and 1 N s/m."""
    axes = (axis(mass, damping, coulomb, step, sign),)
    true = Device(name="true", axes=axes, sensing_delay=sensing, actuation_delay=acting)
    servo = Servo(true, Device(name="told", axes=(axis(0.05, 1.0, 0.0, step, sign),)), rate)
    return servo.shake(wall_jumps((0.0,), force, 1.0, 1.0 / rate))


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


@functools.cache
def twisted(inertia=2e-4, damping=0.006, coulomb=3e-4, rate=2000.0, torque=0.05):
    """Rows of a servo whose coupling turns a handle towards a tool that jumps; it believes another inertia and b."""
    told = load_device("desktop")
    theta = told.axes[2].model_copy(update={"mass": inertia, "damping": damping, "coulomb": coulomb})
    true = told.model_copy(update={"axes": (*told.axes[:2], theta), "actuation_delay": 2e-4})
    servo = Servo(true, told, rate, {"exchange.hold": 2.0, "coupling.rotational_damping": 0.0})
    servo.tool.sequence = 1.0
    plan = tool_twists(0.0, torque, 2.0, told.axes[2].damping, told.axes[2].mass, 1.0 / rate)
    for dwell in np.random.default_rng(3).uniform(0.03, 0.15, 40):
        twist, angle = next(plan), servo.state.position[0, 2]
        servo.tool.sent = servo.first * servo.period
        servo.tool.position[0, 2] = min(angle + twist.leash, max(angle - twist.leash, twist.angle))
        servo.run(dwell, {"coupling.rotational_stiffness": twist.stiffness})
    return np.concatenate(servo.blocks)


@pytest.mark.parametrize("true", [{}, {"inertia": 5e-5, "damping": 0.002, "coulomb": 1e-3, "rate": 1000.0}])
def test_a_rotation_is_recognized_by_values_the_servo_was_not_told(true):
    rows = twisted(**true)
    true = {"inertia": 2e-4, "damping": 0.006, "coulomb": 3e-4, "delay": 2e-4, "bias": 0.0, **true}
    found = identify(trace_of(rows, 2, 1.0 / 40000.0), 1e-4, 0.004)
    for name in NAMES:
        estimate, value = getattr(found, name), true["inertia" if name == "mass" else name]
        assert abs(estimate.value - value) <= 3.0 * estimate.confidence + 1e-12
    assert found.mass.confidence < 2e-3 * true["inertia"]
    assert found.damping.confidence < 1e-2 * true["damping"]
    assert found.coulomb.confidence < 2e-5
    assert found.delay.confidence < 2e-5


def test_the_torque_of_a_twist_is_never_more_than_is_allowed():
    rows = twisted()
    assert 0.03 < np.max(np.abs(rows["force_on_handle"][:, 2])) <= 0.05 * 1.001


def test_a_weaker_shake_leaves_a_wider_confidence():
    assert found(force=0.5).mass.confidence > 2.0 * found().mass.confidence


def test_a_constant_force_is_told_from_friction():
    trace = trace_of(shaken(), 0, 5e-6)
    pulled = identify(trace._replace(force=trace.force - 0.2), 0.1, 3.0)
    assert pulled.bias.value == pytest.approx(0.2, abs=1e-3)
    assert pulled.coulomb.value == pytest.approx(0.02, abs=1e-3)


def test_the_encoder_step_is_what_all_changes_of_the_counts_are_made_of():
    for every in (1, 4):
        counts = every * np.array([0, 1, 1, 3, 2, -7])
        assert resolution_of(counts, -1e-5) == pytest.approx(every * 1e-5)
    with pytest.raises(ValueError, match="the counts never changed"):
        resolution_of(np.zeros(9), 1e-5)


def test_a_trace_that_tells_nothing_is_refused_in_a_sentence():
    time = np.arange(4000) * 1e-3
    still = Trace(time, time, np.zeros(4000), np.zeros(4000))
    for trace, sentence in (
        (still, "the motor force never changed"),
        (still._replace(force=np.sin(time)), "the handle never moved"),
        (Trace(*(column[:501] for column in still)), "the trace lasts 0.5 s; 1.6 s are the least"),
        (Trace(*(column[:0] for column in still)), "the trace lasts 0 s; 1.6 s are the least"),
    ):
        with pytest.raises(ValueError, match=sentence):
            identify(trace, 0.1, 1.0)


BLOCKED = "the handle never moved|in . of the .. stretches of 0.2 s; 8 are needed: is it blocked"


UNKNOWN = "moved by 0.00.* m under forces .* leaves its mass unknown, .* kg$"


def test_a_handle_held_by_a_stiff_spring_leaves_its_mass_unknown_and_a_blocked_one_is_refused():
    """In N/m; what is blocked moves by two steps, or by none, or slips once: then it would come out quite certain."""
    trace = trace_of(shaken(), 0, 5e-6)
    for stiffness, sentence in ((2e4, UNKNOWN), (1e6, BLOCKED), (1e9, BLOCKED)):
        with pytest.raises(ValueError, match=sentence):
            identify(trace._replace(position=np.round(trace.force / stiffness / 5e-6) * 5e-6), 0.05, 1.0)
    flicker = np.random.default_rng(1).integers(0, 2, trace.time.size)
    for tick, steps in ((2000, 1), (2000, 40), (3100, 1), (3100, 40)):
        slip = steps * (np.arange(trace.time.size) > tick)
        with pytest.raises(ValueError, match=BLOCKED):
            identify(trace._replace(position=5e-6 * (flicker + slip)), 0.05, 1.0)


def test_a_device_that_pauses_for_half_a_segment_is_refused():
    trace = trace_of(shaken(), 0, 5e-6)
    with pytest.raises(ValueError, match="latched nothing for 0.15 s; 0.1 s is the longest pause"):
        identify(trace._replace(time=trace.time[::300].repeat(300)[: trace.time.size]), 0.05, 1.0)


def test_a_device_that_latches_at_a_quarter_of_the_rate_is_recognized():
    trace = trace_of(shaken(), 0, 5e-6)
    slow = {name: getattr(trace, name)[::4].repeat(4)[: trace.time.size] for name in ("time", "position")}
    identified = identify(trace._replace(**slow), 0.05, 1.0)
    assert identified.mass.value == pytest.approx(0.1, rel=1e-3)
    assert identified.damping.value == pytest.approx(3.0, rel=1e-3)


def test_a_refusal_names_the_axis():
    rows = shaken().copy()
    rows["counts"] = 0
    with pytest.raises(ValueError, match="^axis x: the handle never moved"):
        estimate(rows, 0, axis(0.1, 3.0, 0.02, 5e-6))


def test_a_trace_with_gaps_is_refused():
    rows = shaken()
    with pytest.raises(ValueError, match="has gaps; every tick is needed"):
        trace_of(np.concatenate([rows[:100], rows[101:]]), 0, 5e-6)


def ticks(first, last):
    """A block of the trace at 1 kHz, from tick to tick."""
    rows = np.zeros(last - first, records.TRACE_ROW)
    rows["tick"] = np.arange(first, last)
    rows["deadline"] = rows["tick"] * 1e6
    return rows


def test_of_a_broken_trace_the_longest_run_after_the_settling_is_taken():
    for lost in (0, 1):
        rows = unbroken([ticks(0, 900), ticks(900, 1500), ticks(1500 + lost, 4000)])
        assert rows["tick"][[0, -1]].tolist() == [1501 if lost else 1000, 3999]
    assert len(unbroken([ticks(0, 900)])) == 0


def test_the_description_that_is_written_can_be_loaded_and_keeps_what_was_not_found(tmp_path):
    described = load_device("desktop")
    values = {"mass": (0.2, 1e-3), "damping": (1.5, 0.02), "coulomb": (0.04, 1e-3), "bias": (0.0, 1e-3)}
    values |= {"delay": (4e-4, 1e-5), "resolution": (5e-6, None), "residual": (2e-6, None)}
    turning = values | {"mass": (3e-4, 1e-6), "delay": (8e-4, 1e-2)}
    write_description(tmp_path / "found.yaml", described, {"x": values, "y": values, "theta": turning})
    device = load_device(str(tmp_path / "found.yaml"))
    assert (device.axes[0].mass, device.axes[1].damping, device.axes[1].coulomb) == (0.2, 1.5, 0.04)
    assert (device.axes[2].mass, device.axes[2].counts_per_unit) == (3e-4, described.axes[2].counts_per_unit)
    assert device.sensing_delay + device.actuation_delay == pytest.approx(4e-4, abs=1e-9)
    text = (tmp_path / "found.yaml").read_text()
    assert "mass 0.2 ± 0.001 kg" in text
    assert "mass 0.0003 ± 1e-06 kg m²" in text


def shaken_linkage(name, rate=2000.0):
    """Rows of a servo that shakes a linkage in the middle of its workspace, and (device, told): it believes joints of
    half the inertia and twice the damping, with some friction, and knows no delay."""
    shipped = load_device(name).joints
    rubbing = [one.model_copy(update={"coulomb": max(one.coulomb, 0.002 * one.torque_limit)}) for one in shipped]
    device = load_device(name).model_copy(update={"joints": tuple(rubbing), "actuation_delay": 3e-4})
    wrong = [{"inertia": 0.5 * one.inertia, "damping": 2.0 * one.damping, "coulomb": 0.0} for one in device.joints]
    joints = tuple(one.model_copy(update=each) for one, each in zip(device.joints, wrong, strict=True))
    told = parse(content_of(device.model_copy(update={"joints": joints, "actuation_delay": 0.0})), name)
    middle = [sum(along) / 2.0 for along in device.handle.used]
    servo = Servo(device, told, rate)
    servo.state.position[0, : len(middle)] = middle
    return servo.shake(wall_jumps(middle, _force(told), told.axes[0].damping, 1.0 / rate)), device, told


@pytest.mark.parametrize("name", ["serial_2r", "pantograph_mk2", "hapkit"])
def test_joints_of_a_linkage_are_recognized_one_by_one_and_written_as_joints(name, tmp_path):
    rows, device, told = shaken_linkage(name)
    found = {joint.name: estimate_joint(rows, i, told) for i, joint in enumerate(told.joints)}
    for i, joint in enumerate(device.joints):
        assert np.abs(rows["torque"][:, i]).max() < joint.limit
        values = {figure: value for figure, (value, _) in found[joint.name].items()}
        assert values["mass"] == pytest.approx(joint.inertia, rel=0.02)
        assert values["damping"] == pytest.approx(joint.damping, rel=0.05)
        assert values["coulomb"] == pytest.approx(joint.coulomb, rel=0.2)
        assert values["delay"] == pytest.approx(3e-4, abs=1e-4)
        assert values["resolution"] == pytest.approx(joint.step)
    write_description(tmp_path / "found.yaml", told, found)
    written = load_device(tmp_path / "found.yaml")
    assert (written.kinematics, written.handle) == (device.kinematics, device.handle)
    for joint, true in zip(written.joints, device.joints, strict=True):
        assert joint.inertia == pytest.approx(true.inertia, rel=0.02)
        assert joint.damping == pytest.approx(true.damping, rel=0.05)
    assert "name: x" not in (tmp_path / "found.yaml").read_text()


def test_a_handle_described_as_heavier_than_all_that_turns_is_refused():
    rows, _, told = shaken_linkage("hapkit")
    heavy = told.model_copy(update={"handle": told.handle.model_copy(update={"mass": 0.5})})
    with pytest.raises(ValueError, match=r"^joint pulley: it turns with .* kg m², less than 0.5 kg at the handle make"):
        estimate_joint(rows, 0, heavy)
