# SPDX-License-Identifier: Apache-2.0
"""Mass, damping, Coulomb friction and delay of one axis from a trace of counts and motor forces, with confidence.

Output error: the device is run again under the forces that the motor really held, by the exact law of the plant, and
the parameters are those whose run lies nearest to the counts. The trace is cut into segments, each with a beginning of
its own, so that a disturbance does not add up. The noise of the reading does not enter the model's run, so there is no
bias from it, as there is in a regression on differentiated counts. Confidence: ±1.96 standard errors with each segment
as one independent draw, which a coloured residual does not fool.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.optimize import OptimizeResult, least_squares
from scipy.signal import savgol_filter

from haptic_device.config.kinematics import Kinematics
from haptic_device.device.axis_rerun import run_segments
from haptic_device.theory.quantity import Array

SEGMENT = 0.2  # [s]
FEWEST = 8  # segments that a confidence can rest on
LEAST_STEPS = 10  # of the encoder that the handle moves in a segment that tells anything
LONGEST_PAUSE = 0.5 * SEGMENT  # [s] between two latches
MOST_DELAY = 0.02  # [s]
SMOOTH = 0.006  # [s] over which accelerations of a linkage are taken
NAMES = ("mass", "damping", "coulomb", "bias", "delay")
TINY, HUGE = 1e-3, 1e3  # times mass and damping of the beginning: where the search ends


class Trace(NamedTuple):
    """One axis of consecutive servo ticks, (ticks): latch, write [s], position [m | rad], force on handle [N | N m]."""

    time: Array
    written: Array
    position: Array
    force: Array


class Estimate(NamedTuple):
    """A value and the half-width of its 95 % interval."""

    value: float
    confidence: float


class Identified(NamedTuple):
    """mass [kg], damping [N s/m], coulomb [N], bias: constant force [N], delay [s]; residual: of position, rms [m].

    About theta kg m², N m s/rad, N m and rad.
    """

    mass: Estimate
    damping: Estimate
    coulomb: Estimate
    bias: Estimate
    delay: Estimate
    residual: float


def trace_of(rows: npt.NDArray[np.void], axis: int, position_per_count: float) -> Trace:
    """Trace of axis 0…2 from servo rows (TICK), in device units: position_per_count [m | rad] carries the sign.

    Raises ValueError, one sentence, where rows do not follow each other.
    """
    if len(rows) < 2 or np.any(np.diff(rows["tick"]) != 1.0):
        raise ValueError(f"the trace of {len(rows)} ticks has gaps; every tick is needed")
    late = np.append(rows["write_delay"][1:], rows["write_delay"][-1])
    start = rows["latched"][0]
    time = (rows["latched"] - start) * 1e-9
    written = (rows["deadline"] - start) * 1e-9 + late
    return Trace(time, written, rows["counts"][:, axis] * position_per_count, rows["force_on_handle"][:, axis].copy())


def joint_trace(
    rows: npt.NDArray[np.void], joint: int, position_per_count: float, kinematics: Kinematics, mass: float, delay: float
) -> tuple[Trace, float]:
    """Trace of a linkage's joint from servo rows (TICK) [s, rad, N m], and what its handle's mass [kg] adds to the
    joint's inertia at the mean pose [kg m²].

    I θ'' + b θ' + friction = τ − m (Jᵀ x'')_joint. The part of the last term that this inertia makes stays with θ'',
    the rest, by other joints and other poses, is taken from the motor's torque so long after it was written [s].

    Raises ValueError, one sentence, where rows do not follow each other.
    """
    trace = trace_of(rows, joint, position_per_count)
    angles = rows["joint"][:, : kinematics.joints]
    poses = np.array([kinematics.pose(*at) for at in angles.tolist()])
    along = poses[:, [2 + joint, 4 + joint]]
    own = mass * float(np.mean(along[:, 0])) ** 2 + mass * float(np.mean(along[:, 1])) ** 2
    tick = _tick(trace)
    motion = np.column_stack([poses[:, :2], angles[:, joint]])
    faster = savgol_filter(motion, 2 * max(2, round(0.5 * SMOOTH / tick)) + 1, 2, 2, tick, axis=0)
    rest = mass * np.sum(along * faster[:, :2], axis=1) - own * faster[:, 2]
    held = np.interp(trace.written + 0.5 * tick + delay, trace.time, rest)
    return trace._replace(force=rows["torque"][:, joint] - held), own


def identify(trace: Trace, mass: float, damping: float, units: tuple[str, str, str] = ("m", "N", "kg")) -> Identified:
    """Identified axis; mass and damping are where the search begins, a factor of five off is near enough.

    units: of the trace's positions and forces and of the mass, for the sentence of a refusal.

    Raises ValueError, one sentence, if the trace is too short, or the motor did not move the handle enough to tell its
    mass, as one that is blocked.
    """
    begins = _segments(trace)
    _refuse_rest(trace, begins, units)
    most = np.max(np.abs(trace.force))
    begin = np.array([mass, damping, 0.01 * most, 0.0, 0.5 * _tick(trace)])
    fit = _Fit(trace, begins, np.array([mass, damping, 0.01 * most, 0.01 * most]))
    first = np.concatenate([begin, trace.position[begins[:-1]], _velocities(trace, begins)])
    low, high = np.full((2, first.size), [[-np.inf], [np.inf]])
    low[: begin.size] = TINY * mass, TINY * damping, 0.0, -most, 0.0
    high[: begin.size] = HUGE * mass, HUGE * damping, most, most, MOST_DELAY
    ends: dict[str, Any] = {"xtol": 1e-8, "ftol": 1e-7, "max_nfev": 60}
    found = least_squares(fit.residual, first, fit.jacobian, (low, high), x_scale="jac", **ends)
    identified = _with_confidence(found, begins)
    _refuse_unknown(identified.mass, trace, units)
    return identified


def resolution_of(counts: npt.ArrayLike, position_per_count: float) -> float:
    """Encoder step [m | rad]: the largest that divides every change of the counts. Raises ValueError at rest."""
    steps = np.unique(np.abs(np.diff(np.asarray(counts).astype(np.int64))))
    steps = steps[steps > 0]
    if steps.size == 0:
        raise ValueError("the counts never changed, so the encoder step cannot be told")
    return float(np.gcd.reduce(steps)) * abs(position_per_count)


class _Fit:
    """Residuals of the run against the trace, and their derivatives by finite differences.

    A segment's beginning moves only that segment, so one run moves all beginnings at once. typical: size of mass,
    damping, coulomb and bias, for the steps.
    """

    def __init__(self, trace: Trace, begins: npt.NDArray[np.intp], typical: Array) -> None:
        self.trace, self.begins, self.typical = trace, begins, typical
        self.count = begins.size - 1
        self.segment = np.repeat(np.arange(self.count), np.diff(begins))
        self.out = np.empty(begins[-1])

    def run(self, parameters: Array) -> Array:
        device, states = parameters[: len(NAMES)], parameters[len(NAMES) :].reshape(2, -1)
        trace = self.trace
        run_segments(
            self.begins, trace.time, trace.written, trace.force, *device, states[0].copy(), states[1].copy(), self.out
        )
        return self.out.copy()

    def residual(self, parameters: Array) -> Array:
        return self.run(parameters) - self.trace.position[: self.begins[-1]]

    def jacobian(self, parameters: Array) -> Array:
        columns = np.zeros((self.begins[-1], parameters.size))
        steps = 1e-4 * np.maximum(np.abs(parameters[: self.typical.size]), self.typical)
        for i, step in enumerate((*steps, 1e-6)):
            columns[:, i] = self._slope(parameters, i, i + 1, step)
        for half, step in ((0, 1e-6), (1, 1e-5)):
            start = len(NAMES) + half * self.count
            slope = self._slope(parameters, start, start + self.count, step)
            columns[np.arange(slope.size), start + self.segment] = slope
        return columns

    def _slope(self, parameters: Array, start: int, end: int, step: float) -> Array:
        ahead, behind = parameters.copy(), parameters.copy()
        ahead[start:end] += step
        behind[start:end] -= step
        return (self.run(ahead) - self.run(behind)) / (2.0 * step)


def _segments(trace: Trace) -> npt.NDArray[np.intp]:
    lasts = float(np.ptp(trace.time)) if trace.time.size else 0.0
    if lasts < FEWEST * SEGMENT:
        raise ValueError(f"the trace lasts {lasts:.3g} s; {FEWEST * SEGMENT:g} s are the least to identify from")
    length = round(SEGMENT / _tick(trace))
    return np.arange(trace.time.size // length + 1) * length


def _tick(trace: Trace) -> float:
    """Of the servo [s]: a device that latches more slowly gives one time to several ticks."""
    return float(trace.time[-1] - trace.time[0]) / (trace.time.size - 1)


def _velocities(trace: Trace, begins: npt.NDArray[np.intp]) -> Array:
    reach = max(2, round(0.005 / _tick(trace)))
    return np.array([np.polyfit(trace.time[i : i + reach], trace.position[i : i + reach], 1)[0] for i in begins[:-1]])


def _refuse_rest(trace: Trace, begins: npt.NDArray[np.intp], units: tuple[str, str, str]) -> None:
    if np.ptp(trace.force) == 0.0:
        raise ValueError("the motor force never changed, so nothing can be told from this trace")
    if np.ptp(trace.position) == 0.0:
        raise ValueError("the handle never moved, so nothing can be told from this trace")
    if (pause := float(np.diff(trace.time).max())) > LONGEST_PAUSE:
        raise ValueError(f"the device latched nothing for {pause:.3g} s; {LONGEST_PAUSE:g} s is the longest pause")
    steps = np.abs(np.diff(trace.position))
    least = LEAST_STEPS * float(steps[steps > 0.0].min())
    ways = np.array([np.ptp(trace.position[i:k]) for i, k in pairwise(begins.tolist())])
    if (moved := int((ways > 0.999 * least).sum())) < FEWEST:  # of a grid that is only as exact as its numbers
        raise ValueError(
            f"the handle moved by {least:.2g} {units[0]}, {LEAST_STEPS} steps of its encoder, in {moved} of the "
            f"{len(ways)} stretches of {SEGMENT:g} s; {FEWEST} are needed: is it blocked, or the force too small?"
        )


def _refuse_unknown(mass: Estimate, trace: Trace, units: tuple[str, str, str]) -> None:
    if not mass.confidence < mass.value:
        way, force, unit = units
        raise ValueError(
            f"the handle moved by {np.ptp(trace.position):.2g} {way} under forces {np.ptp(trace.force):.2g} {force} "
            f"apart, which leaves its mass unknown, {mass.value:.2g} ± {mass.confidence:.2g} {unit}"
        )


def _with_confidence(found: OptimizeResult, begins: npt.NDArray[np.intp]) -> Identified:
    """Values with the sandwich covariance over segments."""
    jacobian, residual = found.jac, found.fun
    scale = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / scale
    bread = np.linalg.pinv(scaled.T @ scaled)
    scores = np.add.reduceat(scaled * residual[:, None], begins[:-1], axis=0)
    count = begins.size - 1
    covariance = bread @ (scores.T @ scores) @ bread * count / (count - 1)
    error = 1.96 * np.sqrt(np.maximum(np.diag(covariance), 0.0)) / scale
    mass, damping, coulomb, bias, delay = map(Estimate, found.x[: len(NAMES)].tolist(), error.tolist())
    return Identified(mass, damping, coulomb, bias, delay, float(np.sqrt(np.mean(residual**2))))
