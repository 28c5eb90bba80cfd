# SPDX-License-Identifier: Apache-2.0
"""Why a display that is enabled gives less force than is wished for. The table below is the only one; documents are
made from it.

A cause counts where it lasts (WithheldTime): for a moment a display that works has each of them.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from haptic_device.control import enable_state, exchange_controller, faults, rows
from haptic_device.jit import kernel, njit

FELT = 0.05  # of engage.force and engage.torque: a coupling that is short by less is not
LEAST_ANGLE = 1.0  # [°] below which a tool is not said to be turned
LASTS = 0.2  # [s] beyond which a cause counts
BREAK = 0.02  # [s] without it that end it: a handle that moves pays for a tick now and then
SHORT = "the tool's port keeps its force short, for want of energy or by its limit, and the hand feels as little"
"""What the simulation withholds, named tool_port beside the causes of the driver."""
_SECOND = 1e-9


class Withheld(NamedTuple):
    """bit: in the column `withheld`; cause: what keeps the force back; cure: what a person does; number: how much,
    from the servo's row; holds: whether the coupling holds the tool as it is drawn; leads: whether it ends when the
    handle comes to the tool."""

    bit: int
    name: str
    cause: str
    cure: str
    number: Callable[[np.record], str] = lambda row: ""
    holds: bool = True
    leads: bool = False


TABLE: list[Withheld] = []
"""In the order of what to say first."""


def _cause(name: str, *row, **more) -> int:
    """Bit of the next row of the table. Traces have the bits: a new row is the last."""
    TABLE.append(Withheld(1 << len(TABLE), name, *row, **more))
    return TABLE[-1].bit


CLUTCH = _cause("clutch", "the clutch is open", "set clutch.open to false", holds=False)
WAITING = _cause(
    "waiting",
    "forces begin only once those wanted are below engage.force and engage.torque",
    "lead the handle to the tool and out of the walls",
    lambda row: f"{_sum(row.force_walls + row.force_coupling)} are wanted, the tool is {_apart(row)} from the handle",
    holds=False,
    leads=True,
)
NO_TOOL = _cause("no_tool", "no simulation: the handle is in free space", "start haptic_simulation", holds=False)
FAR_TOOL = _cause(
    "far_tool",
    "a tool that comes back must be near enough for a force below engage.force and engage.torque",
    "lead the handle to the tool, or call ~/disable and ~/enable",
    lambda row: f"it is {_apart(row)} from the handle",
    holds=False,
    leads=True,
)
OLD_TOOL = _cause(
    "old_tool",
    "tool samples older than exchange.hold let the coupling go, and it returns over exchange.fade",
    "see why the simulation answers late, or raise exchange.hold",
    lambda row: (
        f"the newest is {row.tool_age * 1e3:.0f} ms old, {row.exchange_fade * 1e2:.0f} % of the coupling is there"
    ),
    holds=False,
)
TANK = _cause(
    "tank",
    "the energy tank cannot pay for the coupling, which is kept short",
    "move the handle, which fills the tank, or lead it to the tool; a greater passivity margin fills it faster",
    lambda row: f"{row.exchange_tank * 1e3:.3g} mJ are in it, the tool is {_apart(row)} from the handle",
    holds=False,
    leads=True,
)
RELEASED = _cause(
    "released_walls",
    "walls push less, to take back energy that was given and not paid for",
    "move the handle, which pays, and lead it out of all walls",
    lambda row: f"they push with {np.hypot(*row.force_walls[:2]):.3g} N",
)
UNPAID = _cause(
    "unpaid_rise",
    "the rise of forces after enabling waits for energy",
    "lead the handle out of the walls and to the tool, or call ~/disable and ~/enable",
    lambda row: f"they are at {row.engage * 1e2:.0f} %",
    leads=True,
)
CHANGE = _cause(
    "change",
    "new settings are not all in force: their rise waits until it is paid or the handle is off the walls",
    "lead the handle off the walls and to the tool",
)
LIMIT = _cause(
    "limit",
    "more force is wanted than force.limit or the motor holds",
    "push less, towards the tool and out of the walls; or raise force.limit",
    lambda row: f"the motor holds {_sum(row.force_on_handle)}",
)


def sentence(standing: dict[str, float], row) -> str:
    """That force is withheld, and of the first cause time, number and cure; "" where none stands.

    standing: {name: time [s]} in the order of the table (WithheldTime); row: the newest of the servo.
    """
    first = next((each for each in TABLE if each.name in standing), None)
    if first is None:
        return ""
    told = "; ".join(filter(None, (first.cause, first.number(row), first.cure)))
    others = "".join(f"; also {name}" for name in standing if name != first.name)
    return f"force withheld for {standing[first.name]:.1f} s ({first.name}): {told}{others}"


def _sum(force):
    """Of forces on the plane [N], and the torque [N m]."""
    return f"{math.hypot(force[0], force[1]):.3g} N and {abs(force[2]):.3g} N m"


def _apart(row):
    """How far the tool is from the handle, and turned where it is."""
    away = row.tool_position - row.position
    told = f"{math.hypot(away[0], away[1]) * 1e3:.3g} mm"
    angle = abs(math.degrees(away[2]))
    return told + (f" and {angle:.3g}°" if angle > LEAST_ANGLE else "")


@kernel
def tell(settings, state, sensors, tool, output):
    """Fills in the output's sum of the bits of this tick; 0 where no force is asked for: not enabled, or a fault."""
    command, short = int(sensors.command), state.account.short
    state.account.short = 0.0
    if not command & enable_state.ENABLE or output.fault != faults.NONE:
        return
    if command & enable_state.CLUTCH:
        output.withheld = CLUTCH
        return
    if output.state == enable_state.WAITING:
        output.withheld = WAITING
        return
    bits = _why_faded(settings, state, tool, output) if output.exchange_fade < 1.0 else 0
    indebted, waits = state.account.free < 0.0, state.change.share < 1.0
    rising, going = state.enable.ramp < 1.0, state.change.going > 0.0
    less = indebted or (waits and not rising and not going)
    bits += TANK if short > FELT or (indebted and _is_light(state, 0, int(settings.axes), output)) else 0
    bits += RELEASED if less and _is_light(state, rows.WALLS, rows.WALLS + int(settings.wall.count), output) else 0
    bits += UNPAID if waits and rising and not indebted else 0
    bits += CHANGE if going and not indebted else 0
    output.withheld = bits + (LIMIT if _is_limited(settings, state.hold, output) else 0)


@njit
def _why_faded(settings, state, tool, output):
    """Why the coupling is let go; 0 where there is none."""
    coupling, chosen, gains = settings.coupling, settings.exchange, 0.0
    for i in range(int(settings.axes)):
        gains += abs(coupling.stiffness[i]) + abs(coupling.damping[i])
    if gains == 0.0:
        return 0
    if tool.age < 0.0:
        return NO_TOOL
    gone = output.exchange_fade == 0.0 and exchange_controller.asked_to_be_near(state.fade)
    # the stage that lets it go has refused this sample for where it is, not for its age
    if gone and tool.age <= chosen.hold and not exchange_controller.tool_is_near(settings, tool, output.position):
        return FAR_TOOL
    return OLD_TOOL


@njit
def _is_light(state, first, end, output):
    """Whether a row from first to end weighs less than it is wished to."""
    whole, least = output.engage, 1.0
    for r in range(first, end):
        least = min(least, state.rows[r].weight)
    return least < (whole * output.exchange_fade if first == 0 else whole)


@njit
def _is_limited(settings, hold, output):
    """Whether the sum of all forces, or the coupling's spring, is at its limit on an axis."""
    for i in range(int(settings.axes)):
        stretch = output.coupling_position[i] - output.position[i]
        pull = settings.coupling.stiffness[i] * abs(stretch) if output.exchange_fade > 0.0 else 0.0
        wanted = output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]
        if hold.limited[i] > 0.0 or pull > settings.coupling.limit[i] or abs(wanted) > settings.force.limit[i]:
            return True
    return False


class _Spans:
    """The spans of one cause; times [ns] of the ticks' deadlines."""

    def __init__(self) -> None:
        self._begin = self._last = self._ended = 0.0
        self._free = -np.inf  # the last tick without it
        self.longest = 0.0

    def add(self, times: npt.NDArray[np.float64], on: npt.NDArray[np.bool_]) -> None:
        """The next ticks, and in which of them it was on."""
        edges = np.flatnonzero(np.diff(on, prepend=False, append=False))
        for first, end in edges.reshape(-1, 2):
            # missed ticks are no break
            free = times[first - 1] if first else self._free
            if self._last == 0.0 or free - self._last > BREAK / _SECOND:
                self._close()
                self._begin = times[first]
            self._last = times[end - 1]
            self.longest = max(self.longest, self.seconds)
        if not on[-1]:
            self._free = times[-1]

    @property
    def seconds(self) -> float:
        """Length [s] of the last span."""
        return (self._last - self._begin) * _SECOND

    @property
    def total(self) -> float:
        """Time [s] of all spans that lasted."""
        return self._ended + (self.seconds if self.seconds > LASTS else 0.0)

    @property
    def over(self) -> bool:
        """Whether the last span has ended by the last tick."""
        return self._free - self._last > BREAK / _SECOND

    def _close(self) -> None:
        self._ended, self._begin = self.total, self._last


class WithheldTime:
    """Takes the ticks as they come; a cause lasts once it stood for more than LASTS without a BREAK."""

    def __init__(self) -> None:
        self._spans = {cause.name: _Spans() for cause in TABLE}

    def add(self, times: npt.NDArray[np.float64], bits: npt.NDArray[np.float64]) -> None:
        """The next ticks: deadlines [ns] and column `withheld`."""
        if not len(times):
            return
        whole = np.nan_to_num(bits).astype(np.int64)
        for cause in TABLE:
            self._spans[cause.name].add(times, (whole & cause.bit) != 0)

    def standing(self) -> dict[str, float]:
        """{name: time [s] it has stood} of the causes that last now, in the order of the table."""
        return {name: span.seconds for name, span in self._spans.items() if span.seconds > LASTS and not span.over}

    def totals(self) -> dict[str, tuple[float, float]]:
        """{name: time [s] in all, longest [s]} of the causes that have lasted."""
        return {name: (span.total, span.longest) for name, span in self._spans.items() if span.total > 0.0}
