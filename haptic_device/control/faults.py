# SPDX-License-Identifier: Apache-2.0
"""Faults: latched reasons why the motor is off. The table below is the only one; documents are made from it."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from haptic_device.control import linkage
from haptic_device.digits import plain
from haptic_device.message_fields import AXES

# bits of device_status: the sample is of this deadline; the device's watchdog has cut the motor; its e-stop button is
# pressed; it is too hot; an end switch is reached; an encoder is broken by its own check; its clock is not good enough,
# as the bridge finds; the motor value was clamped
FRESH, WATCHDOG, BUTTON, HOT, END_SWITCH, BROKEN_ENCODER, CLOCK, CLAMPED = 1, 2, 4, 8, 16, 32, 64, 128
CUT = WATCHDOG | BUTTON | HOT | BROKEN_ENCODER  # with any of these the device's motors are at zero
DEVICE_BITS = CUT | END_SWITCH | CLOCK | CLAMPED  # those that a device sets
THIS_TICK, NEXT_TICK = "zero in the tick that finds it", "zero in the next tick"
BUSY = "end other programs that keep the machine busy"
DEVICE = "check the device and the line from it: its power, its cable, its program"
WAY_THERE = "check the line to the device: its cable, its network, how busy its machine is"
BY_DEVICE = "zero: cut by the device by itself, and kept so"
SIMULATED, LINE, SERVO = "simulated", "line", "servo"  # places at which a fault comes about
UNITS, FORCES = ("m", "m", "rad"), ("N", "N", "N m")
FINITE = {
    "position": "position",
    "velocity": "velocity",
    "force_walls": "force of the walls",
    "force_coupling": "force of the coupling",
    "force_cancellation": "force of the damping compensation",
}
SUM = tuple(FINITE)[2:]


class Ticks(NamedTuple):
    """Rows of the trace up to the one that latched a fault, the SETTINGS that they were made by, and the device's
    watchdog [s], 0: not known."""

    rows: np.ndarray
    settings: np.void
    watchdog: float

    def of(self, column: str, k: int = -1) -> np.ndarray:
        """A column of row k, by axis."""
        return self.rows[column][k][: int(self.settings["axes"])]

    def device(self, name: str) -> np.ndarray:
        """What the device is, by axis."""
        return self.settings["hardware"][name][: int(self.settings["axes"])]

    @property
    def joints(self) -> int:
        """How many joints of a linkage there are."""
        return int(self.settings["port"]["joints"])

    def drives(self, k: int = -1) -> np.ndarray:
        """What the encoders tell [m, m, rad], of a linkage its joints [rad]."""
        return self.of("counts", k) * self.device("position_per_count") - self.device("zero")

    def places(self, k: int = -1) -> np.ndarray:
        """Of the handle at the device [m, m, rad]."""
        places = self.drives(k)
        if self.joints:
            places[: self.joints] = self._pose(k)[: self.joints]
        return places

    def _pose(self, k: int) -> tuple[float, ...]:
        a, b = np.resize(self.drives(k)[: self.joints], 2)
        return linkage.pose(self.settings["linkage"], a, b)

    def wanted(self, force: np.ndarray, k: int) -> np.ndarray:
        """What motors are wanted to do for these forces on the device's handle [N | N m]."""
        if self.joints:
            jacobian = np.reshape(self._pose(k)[2:6], (2, 2))[: self.joints, : self.joints]
            force = np.concatenate([jacobian.T @ force[: self.joints], force[self.joints :]])
        return force

    def drive(self, i: int) -> dict:
        """Name and units of drive i, where it is a joint."""
        return {"axis": f"joint {i + 1}", "unit": "rad", "force": "N m"} if i < self.joints else {}


class Fault(NamedTuple):
    """code: as in the trace; title: for people; cause: what latched it; first: what a person does before a reset, "" if
    nothing; motor: what it does; number: how much, of the fields that `measure` finds, None where they are not known
    (`at` among them: a better known place); at: {place: (number, first)}."""

    code: int
    name: str
    title: str
    cause: str
    first: str
    motor: str = THIS_TICK
    number: str = ""
    measure: Callable[[Ticks], dict | None] = lambda ticks: None
    at: Mapping[str, tuple[str, str]] = MappingProxyType({})


NONE = 0
TABLE: list[Fault] = []


def _fault(name: str, *row, **more) -> int:
    """Code of the next row of the table. Traces have the codes: a new row is the last."""
    TABLE.append(Fault(len(TABLE) + 1, name, *row, **more))
    return len(TABLE)


def _along(i, **fields):
    return {"axis": AXES[i], "unit": UNITS[i], "force": FORCES[i], **fields}


def _first(beyond, value, limit, drive=lambda i: {}, **more):
    """Fields of the first axis that is beyond its limit; None where none is. drive: of a drive that is no axis."""
    beyond = np.flatnonzero(beyond)
    return next((_along(i, value=value[i], limit=limit[i], **more) | drive(i) for i in beyond), None)


def _silence(ticks):
    waited, limit = (ticks.rows["deadline"][-1] - ticks.rows["latched"][-1]) * 1e-9, ticks.settings["fault"]["silence"]
    return {"time": max(waited, limit), "limit": limit}  # counted in ticks where the device's clock is ahead


def _not_finite(ticks):
    for name, what in FINITE.items():
        for i in np.flatnonzero(~np.isfinite(ticks.of(name))):
            return _along(i, what=what, value="not a number" if math.isnan(ticks.of(name)[i]) else "infinite")
    return None


def _jump(ticks):
    rows = ticks.rows
    if len(rows) < 2:
        return None
    elapsed = (rows["latched"][-1] - rows["latched"][-2] + rows["stamp_error"][-2:].sum()) * 1e-9  # as sensing has it
    way, limit = abs(ticks.drives() - ticks.drives(-2)), 2.0 * ticks.device("velocity_limit") * elapsed
    limit[: ticks.joints] = 2.0 * ticks.settings["port"]["fastest"][: ticks.joints] * elapsed
    return _first(way > limit, way, limit, ticks.drive, time=elapsed * 1e3)


def _outside(ticks):
    place, low, high = ticks.places(), ticks.device("position_low"), ticks.device("position_high")
    return _first(~((low <= place) & (place <= high)), place, np.where(place < low, low, high))


def _fast(ticks):
    speed, limit = abs(ticks.of("velocity")) / ticks.device("scale"), ticks.device("velocity_limit")
    return _first(speed > limit, speed, limit)


def _saturated(ticks):
    """Of the tick before, for in this one nothing is wanted any more."""
    if len(ticks.rows) < 2:
        return None
    most, engage = ticks.settings["force"]["limit"][: int(ticks.settings["axes"])], ticks.rows["engage"][-2]
    total = np.clip(sum(ticks.of(name, -2) for name in SUM), -most, most) * engage
    force = abs(ticks.wanted(ticks.device("scale") * total + ticks.of("force_gravity", -2) * engage, -2))
    limit = ticks.device("motor_limit")
    return _first(force > limit, force, limit, ticks.drive, time=ticks.settings["fault"]["saturation"])


def _unheard(ticks):
    """Where commands were held up, and for how long: at the servo itself if it missed what tells half of the time."""
    longest = float(np.diff(ticks.rows["deadline"]).max(initial=0.0)) * 1e-9
    if longest > max(1.5 * ticks.settings["period"], 0.5 * ticks.watchdog):
        return {"at": SERVO, "time": longest}
    return {"time": ticks.watchdog} if ticks.watchdog else None


def _warm(ticks):
    load = np.sqrt(ticks.of("thermal_load").clip(0.0))
    warmest = int(load.argmax())
    return _along(warmest, value=load.max(), limit=ticks.settings["fault"]["duty"]) | ticks.drive(warmest)


def _where(ticks):
    """Angles of the joints, where a linkage cannot be."""
    return {"place": ", ".join(f"{plain(math.degrees(angle), digits=4)}°" for angle in ticks.drives()[: ticks.joints])}


def _on_switch(ticks):
    told = zip(AXES, ticks.places(), UNITS, strict=False)
    return {"place": ", ".join(f"{axis} = {plain(place, unit)}" for axis, place, unit in told)}


ESTOP = _fault(
    "estop", "Emergency stop", "a person or a program pressed stop", "", "zero in the tick that takes the command"
)
DEVICE_SILENT = _fault(
    "device_silent",
    "Device does not answer",
    "the device did not answer for longer than fault.silence",
    f"{DEVICE}; with a simulated device {BUSY}",
    "zero in the tick that finds it; a device without writes cuts it by itself",
    "no answer for {time} s; the limit is {limit} s",
    _silence,
    {
        SIMULATED: ("no sample of haptic_loopback for {time} s; the limit is {limit} s", BUSY),
        LINE: ("no sample came over the line from the device for {time} s; the limit is {limit} s", DEVICE),
    },
)
NOT_A_NUMBER = _fault(
    "not_a_number",
    "Not a number",
    "a position or a force was not finite",
    "keep the recording and report it",
    number="the {what} along {axis} was {value}",
    measure=_not_finite,
)
ENCODER_JUMP = _fault(
    "encoder_jump",
    "Encoder jump",
    "the position changed faster than twice the velocity limit",
    "check the encoder and its cable",
    number="{axis} moved by {value} {unit} in {time} ms; the limit is {limit} {unit}",
    measure=_jump,
)
POSITION = _fault(
    "position",
    "Handle outside the workspace",
    "the handle left the workspace of the device",
    "lead the handle back into the workspace",
    number="the handle was at {axis} = {value} {unit}; the workspace ends at {limit} {unit}",
    measure=_outside,
)
VELOCITY = _fault(
    "velocity",
    "Handle too fast",
    "the handle was faster than the device's velocity limit",
    "hold the handle still",
    number="{value} {unit}/s along {axis}; the limit is {limit} {unit}/s",
    measure=_fast,
)
SATURATION = _fault(
    "saturation",
    "Motor at its limit for too long",
    "more than a motor's limit was wanted for longer than fault.saturation",
    "lead the handle out of the walls and to the tool",
    NEXT_TICK,
    "{value} {force} wanted along {axis} for {time} s; the limit is {limit} {force}",
    _saturated,
)
DEVICE_WATCHDOG = _fault(
    "device_watchdog",
    "Device cut its motor",
    "the device heard nothing from the servo for too long",
    f"{BUSY}; {WAY_THERE}",
    "zero: cut by the device when its watchdog was over (15 ms by default), and kept so",
    "no command for {time} s",
    _unheard,
    {
        SERVO: ("the servo gave no command for {time} s", BUSY),
        LINE: ("no command came over the line to the device for {time} s; the servo gave it", WAY_THERE),
    },
)
DUTY = _fault(
    "duty",
    "Motor too warm",
    "a motor's thermal load rose above fault.duty",
    "let the motor cool",
    NEXT_TICK,
    "a load of {value} of the limit of {axis}; fault.duty is {limit}",
    _warm,
)
UNATTENDED = _fault(
    "unattended",
    "Driver stood still",
    "the thread that serves the driver, or the one that hears its commands, stood still for fault.unattended",
    BUSY,
    number="the limit is {limit} s",
    measure=lambda ticks: {"limit": ticks.settings["fault"]["unattended"]},
)
DEVICE_ESTOP = _fault(
    "device_estop",
    "Emergency-stop button of the device",
    "the emergency-stop button of the device was pressed",
    "release the button",
    BY_DEVICE,
)
DEVICE_HOT = _fault(
    "device_hot", "Device too hot", "the device was too hot and cut its motors", "let the device cool", BY_DEVICE
)
DEVICE_LIMIT = _fault(
    "device_limit",
    "End switch reached",
    "an end switch of the device was reached while the display was enabled, with forces or waiting for them",
    "lead the handle off the switch",
    number="the handle was at {place}",
    measure=_on_switch,
)
DEVICE_ENCODER = _fault(
    "device_encoder",
    "Encoder broken",
    "an encoder was broken by the device's own check",
    "check the encoder and its cable",
    BY_DEVICE,
)
DEVICE_CLOCK = _fault(
    "device_clock",
    "Clock of the device",
    "the device's clock drifted, was set, or could not be told exactly enough to know when a sample was latched",
    "read what haptic_bridge says of the clock; link_protocol.md says how exact it must be",
)
UNREACHABLE = _fault(
    "unreachable",
    "Linkage where it cannot be",
    "the joints of a linkage were where its links do not meet, or on the other side of a singular pose",
    "check zero, signs and counts of the joints; lead the handle back into the workspace",
    number="the joints were at {place}",
    measure=_where,
)
FAULTS = {fault.name: fault for fault in TABLE}
"""The rows by name."""


def name_of(code):
    """Name of a fault code; "" for none."""
    return TABLE[int(code) - 1].name if 0 < code <= len(TABLE) else ""
