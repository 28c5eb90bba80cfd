# SPDX-License-Identifier: Apache-2.0
"""`haptic zwidth --live`: raises a wall's stiffness on the running driver until it shakes under the loopback's hand.

The search, the gestures and the judgement are those of `haptic_device.theory.probe`; the same device in lock-step
(zwidth_lockstep.py) gives the figures to compare with. Everything is judged on the loopback's truth.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haptic_device.config.description import Device, load_device
from haptic_device.config.files import find
from haptic_device.config.parameter_types import check_value
from haptic_device.config.parameters import OPERATING_POINT
from haptic_device.control import faults
from haptic_device.recording.status import number
from haptic_device.theory import probe
from haptic_device.theory.quantity import finite, positive
from haptic_display.device_tools.pair import on_pair
from haptic_display.device_tools.tuning import Check, Tuning, refuse_other_device
from haptic_display.device_tools.zwidth_lockstep import DEPTH, HAND, LAG, OUT, PHASES, RADIUS, WALL, LockstepDisplay

TOUCHED = (
    *("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping", "coupling.stiffness", "coupling.damping"),
    *("passivity.policy", "passivity.control", "cancellation.ratio"),
)
REST = 0.4  # [s] in free space between two gestures
STALLED = {faults.name_of(code) for code in (faults.DEVICE_SILENT, faults.DEVICE_WATCHDOG)}
REACH = 0.02  # [m] of the circle; the walls stand at its edge
TRIES = 5  # of one touch
CANCELLED = 0.95  # share of the damping, for the free end
STIFFEST = 1e6  # [N/m] that is tried if nobody says otherwise
Say = Callable[[str], object]


class Plan(NamedTuple):
    """Device and its description's path; servo rate [Hz]; damping of the wall [N s/m], largest stiffness [N/m]."""

    device: Device
    path: str
    rate: float
    damping: float
    stiffness_max: float


class LiveDisplay:
    """The running display; `show` and `turn` as of the one in lock-step."""

    def __init__(self, tuning: Tuning, damping: float, resolution: float, say: Say = lambda what: None):
        self._tuning, self._damping, self._resolution, self._say = tuning, damping, resolution, say
        self.energy_given = 0.0

    def show(self, stiffness: float) -> bool:
        """Whether this wall shakes at one touch of some, or latches a fault of the driver; then it is gone again.

        `energy_given` is the most that one of them gave [J].
        """
        self._say(f"touching a wall of {stiffness:.0f} N/m")
        self.energy_given = -np.inf
        return any(self._shakes(stiffness, share * DEPTH) for share in PHASES)

    def _shakes(self, stiffness: float, depth: float) -> bool:
        """Whether it does so again when it is touched again: once may be the machine, which comes late now and then."""
        return self._touch(stiffness, depth) and self._touch(stiffness, depth)

    def _touch(self, stiffness: float, depth: float) -> bool:
        for _ in range(TRIES):
            shook = self._try(stiffness, depth)
            if shook is not None:
                return shook
        raise ValueError(
            f"{TRIES} touches of a wall of {stiffness:g} N/m ended as the machine stalled; is it too busy?"
        )

    def _try(self, stiffness: float, depth: float) -> bool | None:
        """Whether this wall shakes; None if driver or loopback stalled meanwhile, which says nothing of the wall."""
        tuning, latched = self._tuning, ""
        tuning.watch(REST, lambda t: (WALL + OUT, 0.0, 0.0))
        self._wall(stiffness)
        began = self._begin()
        try:
            tuning.watch(probe.GESTURE, lambda t: (WALL + probe.tap_and_press(t, OUT, depth), 0.0, 0.0))
        except ValueError:
            latched = tuning.said("fault")
            if not latched:
                raise
        self._wall(0.0)
        if latched:
            tuning.recover()
        truth = _truth(tuning.truths)
        tuning.watch(REST, lambda t: (WALL + OUT, 0.0, 0.0))
        if latched in STALLED:
            return None
        given = float(_truth(tuning.truths).energy_given[-1] - truth.energy_given[0])
        self.energy_given = max(self.energy_given, given)
        return bool(latched) or probe.shakes(truth, began, self._resolution)

    def turn(self, ratio: float) -> float:
        """Apparent damping on a circle with this share of damping cancelled [N s/m]."""
        self._say(f"in free space, {ratio:.0%} of the damping cancelled")
        self._tuning.watch(REST, lambda t: (0.0, 0.0, 0.0))
        self._tuning.set(cancellation__ratio=ratio)
        began = self._begin()
        self._tuning.watch(probe.CIRCLE, lambda t: (*probe.circle(t, RADIUS), 0.0))
        self._tuning.set(cancellation__ratio=0.0)
        return probe.apparent_damping(_truth(self._tuning.truths), began)

    def free(self, policy: str = "off") -> None:
        """No wall, no coupling, and nothing that would calm what is to be seen; gains are judged by this policy."""
        free = {"cancellation__ratio": 0.0, "coupling__stiffness": 0.0, "coupling__damping": 0.0}
        self._tuning.set(passivity__policy=policy, passivity__control=False, **free)

    def _wall(self, stiffness: float) -> None:
        damping = self._damping if stiffness else 0.0
        walls = {"wall__normals": (1.0, 0.0), "wall__offsets": (WALL,)}
        self._tuning.set(**walls, wall__stiffness=(stiffness,), wall__damping=(damping,))

    def _begin(self) -> float:
        """Forgets the truths so far; time of the loopback at which the gesture begins."""
        self._tuning.look()
        del self._tuning.truths[:-1]
        return self._tuning.truths[-1]["time"][0]


def plan(name: str, period: float, damping: float, stiffness_max: float | None) -> Plan:
    """For a device's name or file, servo period [s], damping of the wall [N s/m], largest stiffness [N/m].

    ValueError for what the driver would not take."""
    positive("period", period, "s")
    finite("damping", damping, "N s/m")
    declared = {parameter.name: parameter for parameter in OPERATING_POINT}
    check_value(declared["servo.rate"], 1.0 / period)
    check_value(declared["wall.damping"], (damping,))
    stiffness_max = STIFFEST if stiffness_max is None else stiffness_max
    positive("stiffness_max", stiffness_max, "N/m")
    path, device = str(Path(find("devices", name)).absolute()), load_device(name)
    for axis, (low, high) in zip("xy", device.handle.used if device.handle else (), strict=False):
        if low > -REACH or high < REACH:
            raise ValueError(
                f"--live moves the handle within {REACH:g} m of its origin; the workspace of {name} is {low:g} to "
                f"{high:g} m along {axis}: leave --live out"
            )
    return Plan(device, path, 1.0 / period, damping, stiffness_max)


def measure(plan: Plan, domain: int | None, namespace: str | None, say: Say) -> dict[str, Any]:
    """Figures of the display, live and in lock-step; say(what) hears of it. Raises ValueError, NodeDiedError."""
    nodes = pair(plan.path, plan.rate)
    return on_pair(domain, namespace, *nodes, lambda there, room, check: _measure(plan, there, room, check, say))


def _measure(plan: Plan, domain: int, namespace: str, check: Check, say: Say) -> dict[str, Any]:
    with contextlib.closing(Tuning(domain, namespace)) as tuning:
        tuning.wait_engaged(check)
        refuse_other_device(tuning.statuses["haptic_driver"], plan.device)
        with tuning.as_found(TOUCHED):
            rate = float(tuning.get(["servo.rate"])["servo.rate"])
            live = LiveDisplay(tuning, plan.damping, 1.0 / plan.device.axes[0].counts_per_unit, say)
            return _figures(live, tuning, plan._replace(rate=rate), say)


def pair(path: str, rate: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters of driver and loopback: no coupling, which some devices could not bear; a light hand that follows."""
    hand = {f"hand.{name}": value for name, value in HAND.items()}
    start = {"motion.name": "follow", "motion.lag": LAG, "motion.start": (0.0, 0.0, 0.0)}
    driver = {"device": path, "servo.rate": rate, "coupling.stiffness": 0.0, "coupling.damping": 0.0}
    return driver, {"device": path, **hand, **start}


def _figures(live: LiveDisplay, tuning: Tuning, plan: Plan, say: Say) -> dict[str, Any]:
    device, _, rate, damping, stiffness_max = plan
    b = device.axes[0].damping
    passive = 2.0 * (b - abs(damping)) * rate
    live.free()
    free = {"none": live.turn(0.0), "cancelled": live.turn(CANCELLED)}
    bound = max(passive, 0.2 * b * rate)
    boundary = probe.find_boundary(live.show, 0.95 * bound, min(stiffness_max, 20.0 * bound))
    shaking = live.show(0.95 * passive) if passive > 0.0 else None
    given, delay = live.energy_given, _write_delay(tuning)
    say("the same in lock-step")
    lockstep = LockstepDisplay(device, rate, damping, delay)
    same = probe.find_boundary(lockstep.show, 0.95 * bound, min(stiffness_max, 20.0 * bound))
    freed = {"none": lockstep.turn(0.0), "cancelled": lockstep.turn(CANCELLED)}
    head = {"rate": rate, "damping": damping, "physical_damping": b, "write_delay": delay, "passive": passive}
    return {
        **head,
        "live": {"quiet": boundary.quiet, "shaking": boundary.shaking, "damping": free},
        "lockstep": {"quiet": same.quiet, "shaking": same.shaking, "damping": freed},
        "at_95_percent_of_passive": {"shaking": shaking, "energy_given": given},
    }


def _write_delay(tuning: Tuning) -> float:
    """Time from deadline to the motor's effect [s]: the median of the servo's writes, and what a bridge adds."""
    tuning.watch(0.6)
    bridge = tuning.statuses.get("haptic_bridge")
    added = number(bridge.values.get("delay_mean_us", "")) if bridge else 0.0
    return (max(0.0, number(tuning.said("write_delay_us_p50"))) + added) * 1e-6


def _truth(truths: list[dict[str, Any]]) -> probe.GroundTruth:
    def column(name: str, part: int) -> np.ndarray:
        return np.array([t[name][part] if name in t else 0.0 for t in truths])

    motion = {"position": column("x", 0), "velocity_x": column("x", 1), "velocity_y": column("y", 1)}
    return probe.GroundTruth(np.array([t["time"][0] for t in truths]), energy_given=column("energy_given", 0), **motion)
