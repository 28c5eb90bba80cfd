# SPDX-License-Identifier: Apache-2.0
"""What the coupling is wished to pull to: the tool's samples, by the exchange method that is set.

A method wishes for the place and the velocity of the coupling's rows.
Every factor on the coupling's force (engaging, fading) is the weight of its rows.
"""

import math

from haptic_device.control import account, exchange_pspm, exchange_samples, fault_watch, faults, virtual_tool
from haptic_device.jit import kernel, njit


@kernel
def wish(settings, state, tool, output):
    """Fills in what the coupling shall pull to, and its fade."""
    _fade(settings, state.fade, state.enable, tool, output)
    number, own = _is_number(tool), state.virtual_tool
    if not number and output.exchange_fade > 0.0:
        fault_watch.latch(state.fault, faults.NOT_A_NUMBER)
    own.spare = 0.0
    if not number:  # no place: no set position moves
        stay(settings, state, output)
        return
    if settings.exchange.method != exchange_samples.DIRECT:
        _take_returned(settings, state.account, state.exchange, tool)
    if settings.exchange.method == exchange_samples.LOCAL and virtual_tool.acts(settings, state, tool):
        virtual_tool.wish(settings, state, tool, output)
    else:
        exchange_pspm.wish(settings, state, tool, output)


@kernel
def spoil(tool, output):
    """A sample that is no number is told as the force that it would be, on its axis or on all."""
    if _is_number(tool) or output.exchange_fade == 0.0:
        return
    for i in range(tool.position.size):
        one = tool.position[i] + tool.velocity[i] + tool.effort[i] + tool.energy + tool.age
        if not abs(one) < math.inf:
            output.force_coupling[i] = math.nan


@kernel
def stay(settings, state, output):
    """The set position stays where it is."""
    output.exchange_fade, output.exchange_released = state.fade.factor, state.fade.released
    for i in range(int(settings.axes)):
        output.coupling_position[i], output.coupling_velocity[i] = state.rows[i].offset, 0.0


@kernel
def moved(settings, state, share, tool, output):
    """The table has moved by this share of what was wished for: what the coupling pulls to, and the handle sample."""
    own, booked, coupling = state.virtual_tool, state.account, state.coupling
    for i in range(int(settings.axes)):
        output.coupling_position[i] = state.rows[i].offset
        output.coupling_velocity[i] *= share
        coupling.set_velocity[i] = output.coupling_velocity[i]
    for i in range(int(settings.axes), output.position.size):  # what the device does not have follows the tool
        output.coupling_position[i], output.coupling_velocity[i] = tool.position[i], tool.velocity[i]
    spare = 0.0
    if own.acting == virtual_tool.ACTING and state.motion.stale_ticks == 0.0:
        spare = virtual_tool.moved(settings, state, share)
    if own.acting == virtual_tool.ACTING:
        output.tools_apart = virtual_tool.apart(settings, own, tool)
    if state.motion.stale_ticks == 0.0:
        account.ship(settings, booked, state.exchange, spare)
    output.exchange_energy = state.exchange.shipped
    output.exchange_tank, output.exchange_shortened = booked.free, booked.shortened
    output.local, output.local_fallbacks = own.acting, own.fallbacks
    output.local_stays, output.local_pivots = own.stays + own.unsolved, own.pivots


@njit
def _take_returned(settings, booked, exchange, tool):
    """Energy that the simulation's side sends back, never more than was shipped there."""
    if tool.session != exchange.tool_session:
        exchange.tool_session, exchange.tool_energy = tool.session, tool.energy
    back = exchange_samples.believed(tool.energy, exchange.tool_energy, exchange.shipped, exchange.returned)
    # what is over is not sent again
    booked.free = max(booked.free, min(settings.exchange.tank, booked.free + back))
    exchange.returned += back
    exchange.tool_energy = max(exchange.tool_energy, tool.energy)


@njit
def _fade(settings, fade, enable, tool, output):
    """The coupling's factor for a tool sample of this age; a tool that (re)joins must be near."""
    # a tool that comes while the force is on must come with a small force; what comes back is paid for where it can be
    fade.apart = 1.0 if enable.ramp == 0.0 else fade.apart
    joining = enable.ramp > 0.0 and fade.factor == 0.0 and asked_to_be_near(fade)
    age = -1.0 if joining and not tool_is_near(settings, tool, output.position) else tool.age
    full, chosen = fade.factor >= 1.0, settings.exchange
    fade.factor = exchange_samples.fade_factor(fade.factor, age, settings.period, chosen.hold, chosen.fade)
    fade.apart = 0.0 if enable.ramp > 0.0 and fade.factor > 0.0 else fade.apart
    fade.released += 1.0 if full and fade.factor < 1.0 else 0.0
    output.exchange_released, output.exchange_fade = fade.released, fade.factor


@kernel
def asked_to_be_near(fade):
    """Whether a tool that (re)joins must be near. Not one that was felt since engaging: what a stretch that comes
    back stores is paid for, or it is shortened."""
    return fade.apart > 0.0


@kernel
def tool_is_near(settings, tool, handle):
    """Whether the coupling to a tool that (re)joins would begin with a small force, as engaging does."""
    stiffness = settings.coupling.stiffness
    # as engaging: in the plane and about theta apart
    pull_y = stiffness[1] * (tool.position[1] - handle[1]) if settings.axes > 1.0 else 0.0
    pull = math.hypot(stiffness[0] * (tool.position[0] - handle[0]), pull_y)
    twist = stiffness[2] * (tool.position[2] - handle[2]) if settings.axes > 2.0 else 0.0
    return pull < settings.engage.force and abs(twist) < settings.engage.torque


@njit
def _is_number(tool):
    """Whether the tool sample is made of numbers; one that is not goes on as it is, to become a fault."""
    # a sum is finite only if all its parts are
    total = tool.energy + tool.age
    for i in range(tool.position.size):
        total += abs(tool.position[i]) + abs(tool.velocity[i]) + abs(tool.effort[i])
    return abs(total) < math.inf
