# SPDX-License-Identifier: Apache-2.0
"""Shakes the handle of a running driver to be identified, and brings the trace home; all gains are put back."""

import contextlib
import time
from collections.abc import Iterator, Sequence

import numpy as np

from haptic_device.config.description import Device
from haptic_device.config.parameters import OPERATING_POINT
from haptic_device.theory.excitation import Jumps, Twist, tool_twists, wall_jumps
from haptic_device.theory.identify import FEWEST, SEGMENT
from haptic_display.device_tools.tuning import Check, Tuning, refuse_other_device

WALLS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping")
QUIET = ("coupling.stiffness", "coupling.damping", "cancellation.ratio", "passivity.policy")
TURNING = ("coupling.rotational_stiffness", "coupling.rotational_damping", "engage.torque")
SETTLING = 1.0  # [s] of the trace that is left out: the handle comes to the first centre
PATIENCE = 60.0  # [s] that the shaking goes on for while every run of the trace is broken too early
EDGE = 0.2  # of the workspace, at either end, that no centre lies in
Plan = Iterator[tuple[Jumps, Twist | None]]


def record_excitation(
    domain: int, namespace: str, check: Check, device: Device, seconds: float, force: float, torque: float | None
) -> np.ndarray:
    """Rows of the longest unbroken trace of the shaking, with at most so much force [N] and torque [N m]."""
    turned = len(device.axes) == 3
    with contextlib.closing(Tuning(domain, namespace, trace=True, tool=turned)) as tuning:
        tuning.wait_engaged(check)
        refuse_other_device(tuning.statuses["haptic_driver"], device, described=False)
        with tuning.as_found((*WALLS, *QUIET, *TURNING)) as found:
            if found["wall.offsets"]:
                raise ValueError(f"the driver shows {len(found['wall.offsets'])} walls; identify it in free space")
            tuning.set(coupling__stiffness=0.0, coupling__damping=0.0, cancellation__ratio=0.0)
            tuning.set(passivity__policy="off")  # walls that jump give energy, and are to
            period = 1.0 / float(tuning.get(["servo.rate"])["servo.rate"])
            plan = _plan(device, _centres(tuning, device), force, torque, period)
            if tuning.tool and torque is not None:
                tuning.tool.refuse_company()
                tuning.set(engage__torque=_engaging(torque / device.scale[1]))
            shake_handle(tuning, plan, seconds, check)
        return unbroken(tuning.rows)


def _engaging(torque: float) -> float:
    """engage.torque at which a coupling that let go of the tool takes hold of it again."""
    [declared] = [parameter for parameter in OPERATING_POINT if parameter.name == "engage.torque"]
    return min(declared.high, max(declared.low, 2.0 * torque))


def _plan(device: Device, centres: Sequence[float], force: float, torque: float | None, period: float) -> Plan:
    """Endless pairs of a Jumps and a Twist, None where nothing turns; centres, force and torque of the device."""
    damping = min(axis.damping for axis in device.axes[:2])
    plane = [centre * device.scale[0] for centre in centres[:2]]
    along = wall_jumps(plane, force / device.scale[0], damping / device.scale[0] ** 2, period)
    if len(device.axes) < 3 or torque is None:
        return ((shake, None) for shake in along)
    theta, scale = device.axes[2], device.scale[1]
    reach = 0.5 * EDGE * (theta.workspace[1] - theta.workspace[0]) * scale
    figures = torque / scale, reach, theta.damping / scale**2, theta.mass / scale**2
    return zip(along, tool_twists(centres[2] * scale, *figures, period), strict=False)


def shake_handle(tuning: Tuning, plan: Plan, seconds: float, check: Check) -> None:
    """Shakes so long; longer on a machine so busy that no run of the trace is long enough to be identified from."""
    end = time.monotonic() + seconds + SETTLING
    while time.monotonic() < end or (time.monotonic() < end + PATIENCE and _too_short(tuning.rows)):
        shake, twist = next(plan)
        gains = {f"wall__{name}": getattr(shake, name) for name in ("normals", "offsets", "stiffness", "damping")}
        if tuning.tool and twist is not None:
            gains |= {"coupling__rotational_stiffness": twist.stiffness, "coupling__rotational_damping": 0.0}
            tool = tuning.tool.simulation
            tool.angle, tool.leash = twist.angle, twist.leash
        tuning.set(**gains)
        tuning.watch(shake.seconds)
        check()


def _centres(tuning: Tuning, device: Device) -> list[float]:
    """Where the handle is, by the trace, but not in the outer fifth of its workspace."""
    centres, place = [], tuning.rows[-1]["position"][-1]
    for i, axis in enumerate(device.axes):
        low, high = axis.workspace
        inset = EDGE * (high - low)
        centres.append(min(high - inset, max(low + inset, place[i] / device.scale[i // 2])))
    return centres


def _too_short(blocks: list[np.ndarray]) -> bool:
    if not blocks:
        return False
    deadline, run = _longest_run(blocks)
    return len(deadline[run]) < 2 or np.ptp(deadline[run]) < 1.01e9 * FEWEST * SEGMENT


def unbroken(blocks: list[np.ndarray]) -> np.ndarray:
    """The longest run of ticks without a gap, after the settling."""
    if not blocks:
        raise ValueError("no trace came from haptic_driver; is publish.trace off?")
    return np.concatenate(blocks)[_longest_run(blocks)[1]]


def _longest_run(blocks: list[np.ndarray]) -> tuple[np.ndarray, slice]:
    """Deadlines [ns] of all ticks, and the slice of them that the longest unbroken run is."""
    deadline, tick = (np.concatenate([block[name] for block in blocks]) for name in ("deadline", "tick"))
    settled = np.searchsorted(deadline, deadline[0] + SETTLING * 1e9)
    breaks = np.flatnonzero(np.diff(tick) != 1.0) + 1
    edges = np.concatenate([[settled], breaks[breaks > settled], [len(tick)]])
    longest = np.argmax(np.diff(edges))
    return deadline, slice(edges[longest], edges[longest + 1])
