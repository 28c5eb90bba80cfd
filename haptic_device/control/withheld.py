# SPDX-License-Identifier: Apache-2.0
"""Why a display that is enabled gives less force than is wished for. The table below is the only one; documents are
made from it.

A cause counts where it lasts (haptic_device/withheld_time.py): for a moment a display that works has each of them.
"""

from typing import NamedTuple

from haptic_device.control import enable_state, exchange_controller, faults
from haptic_device.jit import kernel, njit

CLUTCH, WAITING, NO_TOOL, FAR_TOOL, OLD_TOOL, TANK, RELEASED, UNPAID, CHANGE, LIMIT = (1 << bit for bit in range(10))
FELT = 0.05  # of engage.force and engage.torque: a coupling that is short by less is not
RISEN = 0.999  # of a tick's rise of forces: less is one that was not paid


class Withheld(NamedTuple):
    """bit: in the column `withheld`; cause: what keeps the force back; number: how much, by the fields of
    haptic_device/nodes/withheld_force.py; cure: what a person does."""

    bit: int
    name: str
    cause: str
    number: str
    cure: str


TABLE = (
    Withheld(CLUTCH, "clutch", "the clutch is open", "", "set clutch.open to false"),
    Withheld(
        WAITING,
        "waiting",
        "forces begin only once those wanted are below engage.force and engage.torque",
        "{force:.3g} N and {torque:.3g} N m are wanted, the tool is {apart} from the handle",
        "lead the handle to the tool and out of the walls",
    ),
    Withheld(NO_TOOL, "no_tool", "no simulation: the handle is in free space", "", "start haptic_simulation"),
    Withheld(
        FAR_TOOL,
        "far_tool",
        "a tool that comes back must be near enough for a force below engage.force and engage.torque",
        "it is {apart} from the handle",
        "lead the handle to the tool, or call ~/disable and ~/enable",
    ),
    Withheld(
        OLD_TOOL,
        "old_tool",
        "tool samples older than exchange.hold let the coupling go, and it returns over exchange.fade",
        "the newest is {age:.0f} ms old, {fade:.0f} % of the coupling is there",
        "see why the simulation answers late, or raise exchange.hold",
    ),
    Withheld(
        TANK,
        "tank",
        "the energy tank cannot pay for the coupling, which is kept short",
        "{tank:.3g} mJ are in it, the tool is {apart} from the handle",
        "move the handle, which fills the tank, or lead it to the tool; a greater passivity margin fills it faster",
    ),
    Withheld(
        RELEASED,
        "released_walls",
        "walls push less, to take back the energy that missed ticks gave",
        "they push with {walls:.3g} N",
        "lead the handle out of all walls: then they are whole again",
    ),
    Withheld(
        UNPAID,
        "unpaid_rise",
        "the rise of forces after enabling waits for energy",
        "they are at {ramp:.0f} %",
        "lead the handle out of the walls and to the tool, or call ~/disable and ~/enable",
    ),
    Withheld(
        CHANGE,
        "change",
        "new settings are not all in force: their rise waits until it is paid or the handle is off the walls",
        "",
        "lead the handle off the walls and to the tool",
    ),
    Withheld(
        LIMIT,
        "limit",
        "more force is wanted than force.limit or the motor holds",
        "the motor holds {motor:.3g} N and {twist:.3g} N m",
        "push less, towards the tool and out of the walls; or raise force.limit",
    ),
)
"""In the order of what to say first."""
NAMES = tuple(cause.name for cause in TABLE)


@kernel
def tell(settings, state, sensors, tool, output):
    """Fills in the output's sum of the bits of this tick; 0 where no force is asked for: not enabled, or a fault."""
    command, short = int(sensors.command), state.tank.short
    state.tank.short = 0.0
    if not command & enable_state.ENABLE or output.fault != faults.NONE:
        return
    if command & enable_state.CLUTCH:
        output.withheld = CLUTCH
        return
    if output.state == enable_state.WAITING:
        output.withheld = WAITING
        return
    bits = _why_faded(settings, state, tool, output) if output.exchange_fade < 1.0 else 0
    indebted = state.change.going > 0.0 and state.tank.level < 0.0  # which then holds the dampers, too
    bits += TANK if short > FELT or indebted else 0
    bits += RELEASED if state.walls.release > 0.0 and state.walls.touched > 0.0 else 0
    bits += UNPAID if output.engage < 1.0 and _is_unpaid(settings, state) else 0
    bits += CHANGE if state.change.going > 0.0 and not indebted else 0
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
    gone = output.exchange_fade == 0.0 and exchange_controller.asked_to_be_near(settings, state.fade)
    # the stage that lets it go has refused this sample for where it is, not for its age
    if gone and tool.age <= chosen.hold and not exchange_controller.tool_is_near(settings, tool, output.position):
        return FAR_TOOL
    return OLD_TOOL


@njit
def _is_unpaid(settings, state):
    """Whether forces rose by less than the ramp of engage.time."""
    enable = state.enable
    wanted = enable_state.force_ramp(int(enable.state), enable.ramp_before, settings.period, settings.engage.time)
    rise = wanted - enable.ramp_before
    return rise > 0.0 and enable.ramp - enable.ramp_before < RISEN * rise and state.motion.stale_ticks == 0.0


@njit
def _is_limited(settings, hold, output):
    """Whether the sum of all forces, or the coupling's spring, is at its limit on an axis."""
    for i in range(int(settings.axes)):
        stretch = output.coupling_position[i] - output.position[i]
        pull = settings.coupling.stiffness[i] * abs(stretch) if output.exchange_fade > 0.0 else 0.0
        wanted = output.force_walls[i] + output.force_coupling[i] + output.force_cancellation[i]
        wanted += output.force_passivity[i]
        if hold.limited[i] > 0.0 or pull > settings.coupling.limit[i] or abs(wanted) > settings.force.limit[i]:
            return True
    return False
