# SPDX-License-Identifier: Apache-2.0
"""What the coupling pulls to: the tool's samples, by the exchange method that is set.

A method is a module with `move_set_point`; these share one energy tank. `direct` is the tool as its last sample has it:
nothing is booked, and only lock-step keeps it passive. Energies are of all axes together.
Every factor on the coupling's force (engaging, fading) multiplies its spring, so that its rise is paid as a jump is.
"""

import math

from haptic_device.control import (
    enable_state,
    energy_accounting,
    energy_tank,
    exchange_pspm,
    exchange_samples,
    virtual_tool,
)
from haptic_device.jit import kernel, njit


@kernel
def move_set_point(settings, state, sensors, tool, output):
    """Fills in what the coupling pulls to, its fade, and what the next handle sample carries."""
    method, booked = settings.exchange.method, settings.exchange.method != exchange_samples.DIRECT
    number = _is_number(tool)
    # old counts: any move of the set point could be one that the hand never paid
    if state.motion.stale_ticks > 0.0 and booked and number:
        _stay(settings, state, tool, output)
    else:
        _fade(settings, state.fade, state.enable, tool, output)
        if not booked:
            _pull_to_tool(tool, output)
            return
        if number:
            _begin_tick(settings, state, sensors, output)
            _move(settings, state, method, tool, output)
        else:
            if state.motion.stale_ticks == 0.0:
                _book_hold(settings, state, sensors)
            _no_place(state, tool, output)
    _report(settings, state, tool, output)


@kernel
def tick_ended(settings, state, output):
    """What the spring really holds at the end of the tick; the handle sample carries its force."""
    # no force rises on old counts, so nothing is to be paid
    if state.motion.stale_ticks > 0.0 and settings.exchange.method != exchange_samples.DIRECT:
        energy_tank.tick_ended_unseen(settings, state.tank, state.spring, output)
    else:  # with `direct` for the passivity observer
        energy_tank.tick_ended(settings, state.tank, state.spring, state.motion, output)
    for i in range(output.position.size):
        output.exchange_effort[i] = output.force_coupling[i]


@njit
def _fade(settings, fade, enable, tool, output):
    """The coupling's factor for a tool sample of this age; a tool that (re)joins must be near."""
    # a tool that comes while the force is on must come with a small force; what comes back is paid for where it can be
    fade.apart = 1.0 if enable.ramp == 0.0 else fade.apart
    joining = enable.ramp > 0.0 and fade.factor == 0.0 and asked_to_be_near(settings, fade)
    age = -1.0 if joining and not tool_is_near(settings, tool, output.position) else tool.age
    full, chosen = fade.factor >= 1.0, settings.exchange
    fade.factor = exchange_samples.fade_factor(fade.factor, age, settings.period, chosen.hold, chosen.fade)
    fade.apart = 0.0 if enable.ramp > 0.0 and fade.factor > 0.0 else fade.apart
    fade.released += 1.0 if full and fade.factor < 1.0 else 0.0
    output.exchange_released, output.exchange_fade = fade.released, fade.factor


@njit
def _pull_to_tool(tool, output):
    """Exchange method `direct`: the coupling pulls to the tool's last sample."""
    for i in range(output.position.size):
        output.coupling_position[i], output.coupling_velocity[i] = tool.position[i], tool.velocity[i]


@njit
def _begin_tick(settings, state, sensors, output):
    """The factor that the spring is paid for, and the books of the hold that ends here."""
    tank, spring, hold, motion = state.tank, state.spring, state.hold, state.motion
    # paid for in advance; what does not rise is paid back at the end of the tick
    spring.factor = _most_ramp(settings, state.enable) * output.exchange_fade
    _book_hold(settings, state, sensors)
    energy_accounting.forget_debt(settings, tank, spring, hold, motion, state.observer, sensors.latched)


@njit
def _book_hold(settings, state, sensors):
    tank, spring, hold, motion, enable = state.tank, state.spring, state.hold, state.motion, state.enable
    energy_accounting.hold_ended(settings, tank, spring, hold, motion, enable, sensors)


@njit
def _move(settings, state, method, tool, output):
    """The set point by the method; pspm stands in where the virtual tool does not act."""
    tank, spring, motion, own = state.tank, state.spring, state.motion, state.virtual_tool
    if method == exchange_samples.LOCAL and virtual_tool.acts(settings, own, tank, spring, tool):
        virtual_tool.move_set_point(settings, own, tank, spring, motion, tool, output)
    else:
        exchange_pspm.move_set_point(settings, tank, spring, motion, tool, output)


@njit
def _most_ramp(settings, enable):
    """The most that the force ramp can be in this tick: waiting may end in it."""
    state = enable_state.ENGAGING if enable.state == enable_state.WAITING else int(enable.state)
    return enable_state.force_ramp(state, enable.ramp, settings.period, settings.engage.time)


@njit
def _stay(settings, state, tool, output):
    """A tick whose counts are those of the tick before: where the handle is now nobody knows, so nothing is moved."""
    output.exchange_fade, output.exchange_released = state.fade.factor, state.fade.released
    output.exchange_energy = state.tank.shipped
    if state.virtual_tool.acting == virtual_tool.ACTING:
        output.tools_apart = virtual_tool.apart(settings, state.virtual_tool, tool)
    for i in range(int(settings.axes)):
        output.coupling_position[i] = state.spring.set_position[i]
        output.coupling_velocity[i] = state.spring.set_velocity[i]


@kernel
def asked_to_be_near(settings, fade):
    """Whether a tool that (re)joins must be near. Not one that was felt since engaging, where there is a tank: it pays
    for a stretch that comes back, or shortens it."""
    return fade.apart > 0.0 or settings.exchange.method == exchange_samples.DIRECT


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


@njit
def _no_place(state, tool, output):
    """What is not a number becomes no place: a fault follows, and no set position has moved."""
    for i in range(tool.position.size):
        output.coupling_position[i], output.coupling_velocity[i] = math.nan, tool.velocity[i]
    output.exchange_energy = state.tank.shipped


@njit
def _report(settings, state, tool, output):
    """What tank and virtual tool have counted; axes the device does not have follow the tool."""
    for i in range(int(settings.axes), tool.position.size):
        output.coupling_position[i], output.coupling_velocity[i] = tool.position[i], tool.velocity[i]
    own = state.virtual_tool
    output.exchange_tank, output.exchange_shortened = state.tank.level, state.tank.shortened
    output.local, output.local_fallbacks = own.acting, own.fallbacks
    output.local_stays, output.local_pivots = own.stays + own.unsolved, own.pivots
