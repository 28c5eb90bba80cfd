# SPDX-License-Identifier: Apache-2.0
"""What a film plots below the plane: forces, stretch, energies and the age of the tool sample."""

import numpy as np
import numpy.typing as npt

from haptic_device.control import withheld
from haptic_device.message_fields import AXES
from haptic_device.recording.bag_contents import Joints
from haptic_display.page.film.clock import Array, Clock
from haptic_display.run.report.run import Run
from haptic_sim.scene.shapes import TOOL

HANDLE, ENERGY = "handle", "energy"  # in scene/state, beside the solids
NOT_HELD = sum(cause.bit for cause in withheld.TABLE if not cause.holds)


def curves_of(run: Run, clock: Clock, state: Joints | None, places: dict[str, Array]) -> dict[str, Array]:
    """The curves of a Film, by name. state: scene/state, if there is one; places: where handle and tool were."""
    nothing = np.full(len(clock.times), np.nan)
    distance = 1e3 * np.hypot(*(places[TOOL] - places[HANDLE])[:, :2].T)
    curves = {"motor": nothing, "felt": nothing, "stretch": distance, "given": nothing, "supplied": nothing}
    curves |= {"age": nothing, "oldest": nothing}
    if (motor := _motor(run)) is not None:
        curves["motor"] = clock.mean(motor[0], np.hypot(*motor[1].T))
    if (felt := _felt(run)) is not None:
        curves["felt"] = clock.mean(felt[0], np.hypot(*felt[1].T))
        if "energy_given" in run.ground_truth.names:
            curves["given"] = 1e3 * clock.at(felt[0], run.ground_truth.entry("energy_given"))
    if state is not None and ENERGY in state.names:
        curves["supplied"] = 1e3 * clock.at(run.since(state.stamp), state.entry(ENERGY))
    if run.traced:
        age = np.where(run.rows["tool_age"] >= 0.0, 1e3 * run.rows["tool_age"].astype(float), np.nan)
        curves["age"], curves["oldest"] = clock.mean(run.seconds, age), clock.largest(run.seconds, age)
        if felt is None:  # nobody tells the truth: the servo's own account
            curves["given"] = 1e3 * clock.at(run.seconds, run.rows["energy_given"].sum(axis=1, dtype=float))
    return curves


def _motor(run: Run) -> tuple[Array, Array] | None:
    """Times [s], and force of the motor on the handle in x and y [N]; None if it was not recorded."""
    if run.traced:
        return run.seconds, run.rows["force_on_handle"][:, :2].astype(float)
    try:
        parts = [run.forces(axis).get("on handle") for axis in (0, 1)]
    except ValueError:
        return None
    return None if parts[0] is None else (parts[0][0], np.stack([part[1] for part in parts if part], 1))


def _felt(run: Run) -> tuple[Array, Array] | None:
    """Times [s], and force that the operator's model felt in x and y [N]; None if it was not recorded."""
    if "operator/state" not in run.recording.joints:
        return None
    truth = run.ground_truth
    zero = np.zeros(len(truth.stamp))
    force = [-truth.entry(axis, "effort") if axis in truth.names else zero for axis in AXES[:2]]
    return np.asarray(run.ground_truth_seconds), np.stack(force, 1)


def force_on_hand(run: Run, clock: Clock) -> Array:
    """On the hand in x and y [N], (pictures, 2): as felt, else that of the motor."""
    felt = _felt(run)
    found = felt if felt is not None and len(felt[0]) else _motor(run)
    if found is None:
        return np.full((len(clock.times), 2), np.nan)
    return np.stack([clock.mean(found[0], found[1][:, axis]) for axis in (0, 1)], 1)


def coupling_holds(run: Run, clock: Clock) -> npt.NDArray[np.bool_]:
    """Whether the coupling held the tool, (pictures); without a trace nothing says that it did not."""
    if not run.traced:
        return np.ones(len(clock.times), bool)
    bits = clock.at(run.seconds, np.asarray(run.rows["withheld"], float))
    return (np.nan_to_num(bits).astype(np.int64) & NOT_HELD) == 0
