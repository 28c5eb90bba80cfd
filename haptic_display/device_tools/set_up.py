# SPDX-License-Identifier: Apache-2.0
"""Writes the description of a device by moving its handle: signs, counts per unit, zero, workspace, and motor signs.

position = reference + sign · (counts − counts there) / counts per unit, of each axis; the reference is where all are 0,
or the home that the handle is put to at each start. What a hand cannot tell (mass, damping, limits) stays as it was.
"""

import contextlib
from pathlib import Path
from typing import Any

import numpy as np

from haptic_device.config import yaml_reader
from haptic_device.config.description import Device, parse
from haptic_device.os_errors import naming
from haptic_device.realtime.hardware_interface import COUNTS, STATUS
from haptic_display.device_tools.device_page import CUTS, PageDevice, words_of
from haptic_display.device_tools.identification import content_of
from haptic_display.device_tools.questions import Questions

PUSH = 0.01  # [motor units] most that a motor is given
RAMP = 1000  # ticks of 1 ms that a push takes to rise
FEWEST = 50  # counts that a known way has to have: half a count at either end is 2 %
MOVED = 8  # counts after which a push has moved the handle
SAME = 0.05  # relative difference within which the figure of a description may stand
STILL = np.zeros(3)
Content = dict[str, Any]
"""Of a description, or of one of its axes."""


def set_up(questions: Questions, device: PageDevice, described: Device, name: str, push: float = PUSH) -> Content:
    """The content of a description of this name, with what was measured in place of what `described` says.

    device.tick(motor values (3)) gives a sample of realtime/hardware_interface. Its motors are given at most
    `push` [motor units], one at a time, if that is allowed, and are at zero when this ends. Raises ValueError.
    """
    content = content_of(described) | {"name": name}
    try:
        content |= _homing(questions, described)
        origin = _Origin(questions, device, content)
        for index, axis in enumerate(content["axes"]):
            _scale(questions, device, index, axis)
        _zero(questions, origin, content)
        _workspace(questions, device, origin, content["axes"])
        for index, axis in enumerate(content["axes"]):
            _motor(questions, device, index, axis, push)
    finally:
        with contextlib.suppress(ValueError):  # it is silent, and cuts its motors itself
            device.tick(STILL)
    return content_of(parse(content, name))


def refuse_linkage(described: Device) -> None:
    """ValueError, one sentence, for a device with joints, of which a way along an axis tells nothing."""
    if described.joints:
        raise ValueError(
            f"{described.name} is a {described.kinematics.type}, and set-up measures axes, not joints: write "
            "encoder_sign, counts_per_rad, zero and motor_sign of each joint by hand, with haptic device show beside it"
        )


def write(path: Path, content: Content, began_with: str) -> None:
    """The description as a YAML file, which says at its head what is measured and what is not."""
    head = f"# Set up by haptic device set-up from {began_with}: encoder_sign, counts_per_unit, zero, workspace and\n"
    head += "# motor_sign are measured or given; mass, damping, friction and limits are those of that description.\n"
    with naming(path):
        path.write_text(head + yaml_reader.dump(content), encoding="utf-8")


class _Origin:
    """Counts at the reference pose, asked for when they are needed first."""

    def __init__(self, questions: Questions, device: PageDevice, content: Content):
        self._questions, self._device = questions, device
        self._found: np.ndarray | None = None
        at_start = content["homing"] == "at_start"
        self.place = np.array(content["home"] if at_start else [0.0, 0.0, 0.0])
        where = "to its home" if at_start else "to where all axes are to be 0"
        self._todo = f"Put the handle {where}"

    @property
    def counts(self) -> np.ndarray:
        if self._found is None:
            self._found = _moved(self._questions, self._device, "zero", self._todo)
        return self._found


def _homing(questions: Questions, described: Device) -> Content:
    how = questions.choice(
        "homing",
        "Do the counters keep their place while the device is off (absolute), or is the handle put to its home at each "
        "start (at_start)?",
        ("absolute", "at_start"),
    )
    if how == "absolute":
        return {"homing": how}
    home = list(described.home)
    for index, axis in enumerate(described.axes):
        home[index] = questions.number(f"home.{axis.name}", f"Where is the home along {axis.name}?", _unit(axis.name))
    return {"homing": how, "home": home}


def _scale(questions: Questions, device: PageDevice, index: int, axis: Content) -> None:
    """encoder_sign and counts_per_unit of an axis, by a way of known length."""
    name, unit = axis["name"], _unit(axis["name"])
    if questions.known(f"{name}.counts_per_unit") is not None:
        axis["counts_per_unit"] = questions.number(f"{name}.counts_per_unit", "", f"counts/{unit}")
        axis["encoder_sign"] = _sign(questions, f"{name}.encoder_sign")
        return
    way = f"Move the handle from where it is along +{name} only, by a way that you measure"
    while True:
        before = _counts(device)
        delta = _moved(questions, device, f"{name}.way", way) - before
        length = questions.number(f"{name}.length", f"How far did it move along +{name}?", unit)
        if not (wrong := _wrong_way(delta, index, name, length, unit)):
            break
        questions.say(wrong)
    measured = abs(delta[index]) / length
    axis["encoder_sign"] = 1 if delta[index] > 0 else -1
    if abs(measured / axis["counts_per_unit"] - 1.0) < SAME:
        told = f"{measured:g} counts/{unit} were measured, {axis['counts_per_unit']:g} stand in the description"
        if questions.yes(f"{name}.keep", f"{told}. Keep those of the description?"):
            return
    axis["counts_per_unit"] = float(measured)


def _wrong_way(delta: np.ndarray, index: int, name: str, length: float, unit: str) -> str:
    """Why such a way tells nothing; "" if it does."""
    if length <= 0.0:
        return f"axis {name}: the way is {length:g} {unit}; more than 0 is needed"
    if abs(delta[index]) < FEWEST:
        return f"axis {name}: its counts changed by {delta[index]:.0f}; at least {FEWEST} are needed"
    if index < 2 and abs(other := delta[1 - index]) > abs(delta[index]):
        changed = f"the counts of {'yx'[index]} changed by {other:.0f}, its own by {delta[index]:.0f}"
        return f"axis {name}: {changed}; is the way along another axis, or are two encoders exchanged?"
    return ""


def _zero(questions: Questions, origin: _Origin, content: Content) -> None:
    """Where each axis is at count 0; nothing to know where the handle is put to its home at each start."""
    for index, axis in enumerate(content["axes"]):
        name = axis["name"]
        if content["homing"] == "at_start":
            axis["zero"] = 0.0
        elif questions.known(f"{name}.zero") is not None:
            axis["zero"] = questions.number(f"{name}.zero", "", _unit(name))
        else:
            axis["zero"] = float(0.0 - axis["encoder_sign"] * origin.counts[index] / axis["counts_per_unit"])


def _workspace(questions: Questions, device: PageDevice, origin: _Origin, axes: list[Content]) -> None:
    """The limits of each axis that are not known, by a walk along them."""
    walked: list[int] = []
    for index, axis in enumerate(axes):
        known = questions.known(f"{axis['name']}.workspace")
        axis["workspace"] = known if known is not None else axis["workspace"]
        walked += [] if known is not None else [index]
    if not walked:
        return
    at, low, high = origin.counts, np.full(3, np.inf), np.full(3, -np.inf)

    def look() -> None:
        counts = _counts(device)
        np.minimum(low, counts, out=low)
        np.maximum(high, counts, out=high)

    while True:
        questions.ready("workspace", "Move the handle along all limits of its workspace", look)
        look()
        short = [axes[index]["name"] for index in walked if high[index] - low[index] < FEWEST]
        if not short:
            break
        questions.say(f"the counts of {' and '.join(short)} changed by less than {FEWEST}")
    for index in walked:
        sign, per_unit = axes[index]["encoder_sign"], axes[index]["counts_per_unit"]
        ends = [float(origin.place[index] + sign * (end[index] - at[index]) / per_unit) for end in (low, high)]
        axes[index]["workspace"] = sorted(ends)


def _motor(questions: Questions, device: PageDevice, index: int, axis: Content, push: float) -> None:
    """motor_sign of an axis, by a push that ends as soon as the handle moves."""
    name = axis["name"]
    if questions.known(f"{name}.motor_sign") is not None:
        axis["motor_sign"] = _sign(questions, f"{name}.motor_sign")
        return
    leave = (
        f"Leave the handle free in the middle, hands off: the motor of {name} will push with up to {push:g} motor units"
    )
    if not questions.yes(f"{name}.push", f"{leave} within {RAMP / 1e3:g} s, until the handle moves. May it?"):
        questions.say(f"motor_sign of {name} stays {axis['motor_sign']}, untried")
        return
    moved = _pushed(device, index, push)
    if not moved:
        questions.say(f"{push:g} motor units did not move {name}: motor_sign stays {axis['motor_sign']}, untried")
        return
    axis["motor_sign"] = 1 if moved * axis["encoder_sign"] > 0 else -1


def _pushed(device: PageDevice, index: int, push: float) -> float:
    """Counts that a rising push has moved an axis by; 0 where it has not. Its motor is at zero afterwards."""
    motor, before = np.zeros(3), _counts(device)[index]
    try:
        for tick in range(1, RAMP + 1):
            motor[index] = push * tick / RAMP
            sample = device.tick(motor)
            if int(sample[STATUS]) & CUTS:
                raise ValueError(f"the device takes no motor value: {words_of(int(sample[STATUS]))}")
            if abs(moved := sample[COUNTS + index] - before) >= MOVED:
                return moved
    finally:
        with contextlib.suppress(ValueError):
            device.tick(STILL)
    return 0.0


def _moved(questions: Questions, device: PageDevice, key: str, todo: str) -> np.ndarray:
    """Counts when the handle is where it was asked to be moved."""
    questions.ready(key, todo, lambda: _counts(device))
    return _counts(device)


def _counts(device: PageDevice) -> np.ndarray:
    return device.tick(STILL)[COUNTS : COUNTS + 3].copy()


def _sign(questions: Questions, key: str) -> int:
    if (sign := questions.number(key, "", "1 or -1")) not in (1.0, -1.0):
        raise ValueError(f"{key} is {sign:g}; 1 or -1 is needed")
    return int(sign)


def _unit(name: str) -> str:
    return "rad" if name == "theta" else "m"
