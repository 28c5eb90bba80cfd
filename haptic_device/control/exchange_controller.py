# SPDX-License-Identifier: Apache-2.0
"""What the coupling pulls to: the tool's samples, by the exchange method that is set. A part of the servo's tick.

Energies are of all axes together; the tank is filled and paid as control/set_position has it, the port as
control/wave_variables has it. Every factor on the coupling's force (engaging, fading) multiplies its spring, so that
its rise is paid as a jump is.
"""

import math

from haptic_device.control import (
    enable_state,
    energy_tank,
    exchange_samples,
    set_position,
    virtual_coupling,
    virtual_tool,
    wave_variables,
)
from haptic_device.jit import kernel, njit

AXES = 3
CORRECTION = 2.0  # [1/s] at which the wave method's port is led back to where the tool is


@kernel
def follow(settings, memory, row):
    """Fills in coupling_position, coupling_velocity, exchange_fade, exchange_energy and exchange_effort of the row."""
    if memory.unseen > 0.0 and settings.exchange_method != exchange_samples.DIRECT and _is_number(row):
        _stay(settings, memory, row)
        return
    hold, fade = settings.exchange_hold, settings.exchange_fade
    joining = (
        memory.engage > 0.0
        and memory.exchange_fade == 0.0
        and not exchange_samples.is_modulated(settings.exchange_method)
    )
    age = -1.0 if joining and not _tool_is_near(settings, row) else row.tool_age
    full = memory.exchange_fade >= 1.0
    memory.exchange_fade = exchange_samples.fade_factor(memory.exchange_fade, age, settings.period, hold, fade)
    memory.let_go += 1.0 if full and memory.exchange_fade < 1.0 else 0.0
    row.exchange_let_go = memory.let_go
    row.exchange_fade = memory.exchange_fade
    if settings.exchange_method == exchange_samples.DIRECT or not _is_number(row):
        _as_it_is(settings, memory, row)
        return
    memory.factor = _risen(settings, memory) * row.exchange_fade
    energy_tank.fill(settings, memory, row)
    if settings.exchange_method == exchange_samples.LOCAL and virtual_tool.acts(settings, memory, row):
        virtual_tool.move(settings, memory, row)
    elif exchange_samples.is_modulated(settings.exchange_method):
        _modulate(settings, memory, row)
    else:
        _take_waves(settings, memory, row)
    _keep(settings, memory, row)


@kernel
def settle(settings, memory, row):
    """At the end of the tick: what the coupling's spring really holds, and what the encoder's step may hide.

    A factor that was paid for and did not rise is paid back. One that falls between two samples of the counts is not,
    and the tank is empty then: what the handle did until the spring was let go, nobody knows. The handle may be half an
    encoder step from where it is booked: a change of force that is not the handle's own costs that much way (the rest
    is the friction's, as with any sampled spring: Abbott & Okamura 2005).
    """
    factor = row.engage * row.exchange_fade
    if memory.unseen > 0.0 and settings.exchange_method != exchange_samples.DIRECT:
        _let_go_unseen(settings, memory, factor)
        return
    for i in range(int(settings.axes)):
        stretch = row.coupling_position[i] - row.position[i]
        stiffness, limit = factor * settings.stiffness[i], factor * settings.coupling_limit[i]
        push = factor * settings.damping[i] * _unpaid(settings, memory, row, i)
        if abs(stretch) < math.inf and abs(push) < math.inf:
            memory.tank += virtual_coupling.spring_store(memory.spring[i], memory.clamp[i], stretch)
            memory.tank -= virtual_coupling.spring_store(stiffness, limit, stretch)
            own = abs(stretch - memory.stretched[i]) - settings.scale[i] * abs(memory.moved[i])
            full = virtual_coupling.spring_force(settings.stiffness[i], settings.coupling_limit[i], stretch)
            change = stiffness * max(0.0, own) + abs(push - memory.push[i])
            change += abs((factor - memory.factor_held) * full)
            memory.tank -= energy_tank.hidden_energy(settings, i, change)
            memory.push[i], memory.stretched[i] = push, stretch
            memory.damped[i] = factor * settings.damping[i] * row.velocity[i]
        memory.spring[i], memory.clamp[i] = stiffness, limit
    memory.factor = memory.factor_held = factor


@njit
def _unpaid(settings, memory, row, i):
    """Velocity [m/s | rad/s] at which the damper pulls and that only the tank pays for: waves pay for their port's."""
    paid = memory.own_velocity[i] if settings.exchange_method == exchange_samples.WAVE else 0.0
    return row.coupling_velocity[i] - paid


@njit
def _let_go_unseen(settings, memory, factor):
    """A tick whose counts are old: nothing rises in it (control/servo), and what falls is not paid back."""
    if factor < memory.factor:
        memory.tank, memory.factor = min(0.0, memory.tank), factor
        for i in range(int(settings.axes)):
            memory.spring[i], memory.clamp[i] = factor * settings.stiffness[i], factor * settings.coupling_limit[i]
            memory.damped[i] = math.nan  # more than one force in one hold


@njit
def _risen(settings, memory):
    """The most that engaging can be in this tick: waiting may end in it."""
    state = enable_state.ENGAGING if memory.state == enable_state.WAITING else int(memory.state)
    return enable_state.engage_factor(state, memory.engage, settings.period, settings.engage_time)


@njit
def _stay(settings, memory, row):
    """A tick whose counts are those of the tick before: where the handle is now nobody knows, so nothing is moved."""
    row.exchange_fade, row.exchange_let_go, row.exchange_energy = memory.exchange_fade, memory.let_go, memory.shipped
    if memory.acting == virtual_tool.ACTING:
        row.tools_apart = virtual_tool.apart(settings, memory, row)
    for i in range(int(settings.axes)):
        row.coupling_position[i], row.coupling_velocity[i] = memory.set[i], memory.set_velocity[i]
        row.exchange_effort[i] = memory.sent[i]
    _keep(settings, memory, row)


@njit
def _tool_is_near(settings, row):
    """Whether the coupling to a tool that (re)joins would begin with a small force, as engaging does.

    With pspm nobody asks: there the tank pays for a stretch that comes back, or shortens it.
    """
    pull = math.hypot(
        settings.stiffness[0] * (row.tool_position[0] - row.position[0]),
        settings.stiffness[1] * (row.tool_position[1] - row.position[1]) if settings.axes > 1.0 else 0.0,
    )
    twist = settings.stiffness[2] * (row.tool_position[2] - row.position[2]) if settings.axes > 2.0 else 0.0
    return pull < settings.engage_force and abs(twist) < settings.engage_torque


@njit
def _is_number(row):
    """Whether the tool sample is made of numbers; one that is not goes on as it is, to become a fault."""
    total = row.tool_energy + row.tool_age
    for i in range(AXES):
        total += abs(row.tool_position[i]) + abs(row.tool_velocity[i]) + abs(row.tool_effort[i])
    return abs(total) < math.inf


@njit
def _as_it_is(settings, memory, row):
    """The tool as it is said to be; where a method would have to book it, what is not a number becomes no place."""
    for i in range(AXES):
        row.coupling_position[i], row.coupling_velocity[i] = row.tool_position[i], row.tool_velocity[i]
        if settings.exchange_method != exchange_samples.DIRECT:
            row.coupling_position[i], row.exchange_effort[i] = math.nan, memory.sent[i]
    if settings.exchange_method != exchange_samples.DIRECT:
        row.exchange_energy = memory.shipped
        _keep(settings, memory, row)


@njit
def _modulate(settings, memory, row):
    """Set position after the tool's samples, foretold, as far as slew and tank allow (control/set_position, 2)."""
    energy_tank.take_returned(settings, memory, row)
    for i in range(int(settings.axes)):
        memory.goal[i] = _foretold(settings, row, i)
    energy_tank.pay(settings, memory, row)
    force_square = 0.0
    for i in range(int(settings.axes)):
        own = memory.own_velocity[i]
        most, least = max(0.0, row.tool_velocity[i]), min(0.0, row.tool_velocity[i])
        velocity = _damper_slewed(settings, memory, i, min(most, max(least, own)))
        memory.set_velocity[i] = velocity
        force = settings.scale[i] * memory.factor * settings.damping[i] * velocity
        if force != 0.0:
            force_square += force * force / max(0.0, settings.surplus[i])
    share = set_position.damper_share(
        memory.tank - energy_tank.reserve(settings, memory), force_square, settings.period
    )
    for i in range(int(settings.axes)):
        memory.set_velocity[i] *= share
        row.coupling_position[i], row.coupling_velocity[i] = memory.set[i], memory.set_velocity[i]
        row.exchange_effort[i] = 0.0
    if memory.tank > settings.exchange_tank:
        memory.shipped += memory.tank - settings.exchange_tank
        memory.tank = settings.exchange_tank
    row.exchange_energy = memory.shipped


@njit
def _foretold(settings, row, i):
    """Where the tool is now, in contact or free [m | rad]."""
    position, velocity, age = row.tool_position[i], row.tool_velocity[i], row.tool_age
    straight = set_position.foretold(position, velocity, age, settings.exchange_horizon)
    if row.tool_contact > 0.0 or settings.stiffness[i] <= 0.0:
        return straight
    stretch = row.tool_effort[i] / settings.stiffness[i]
    age = max(0.0, min(age, settings.exchange_horizon))
    return set_position.beside(
        straight, row.position[i], stretch, age, settings.exchange_agility[i], _trust(settings, i)
    )


@njit
def _trust(settings, i):
    """Age [s] at which half of a free tool's force is believed: (2 b + B)/K, of what of b is not cancelled."""
    left = (1.0 - settings.cancellation_ratio) * settings.physical_damping[i] / settings.scale[i] ** 2
    return max(0.0, 2.0 * left + settings.damping[i]) / settings.stiffness[i]


@njit
def _take_waves(settings, memory, row):
    """Port behind the coupling that the waves from the tool move, and the waves it sends back."""
    _receive_waves(settings, memory, row)
    for i in range(int(settings.axes)):
        tool = set_position.foretold(
            row.tool_position[i], row.tool_velocity[i], row.tool_age, settings.exchange_horizon
        )
        memory.goal[i] = memory.set[i] + CORRECTION * settings.period * (tool - memory.set[i])
    energy_tank.pay(settings, memory, row)
    memory.tank = min(memory.tank, settings.exchange_tank)
    share = _play(settings, memory)
    for i in range(int(settings.axes)):
        incoming = share * memory.wave[i]
        memory.pending[i] -= memory.wave[i] * settings.period  # what energy does not cover is dropped, or it grows
        _move_port(settings, memory, row, i, incoming)
    share = _felt_share(settings, memory)
    for i in range(int(settings.axes)):
        port = memory.own_velocity[i]
        memory.set_velocity[i] = port + share * (memory.set_velocity[i] - port)
        row.coupling_position[i], row.coupling_velocity[i] = memory.set[i], memory.set_velocity[i]
        row.exchange_effort[i] = memory.sent[i]
    row.exchange_energy = memory.shipped


@njit
def _move_port(settings, memory, row, i, incoming):
    """Port of axis i for an incoming wave, as fast as the slew lets the spring change; and the wave that goes back.

    The damper's force on the handle changes by its own slew; the tank pays for what lies between.
    """
    stiffness, limit, moved = memory.spring[i], memory.clamp[i], settings.scale[i] * memory.moved[i]
    damping, z, period = (
        memory.factor * settings.damping[i],
        wave_variables.impedance(settings.stiffness[i]),
        settings.period,
    )
    spring = stiffness * (row.position[i] - memory.set[i])
    wanted = wave_variables.port_velocity(incoming, spring, damping, row.velocity[i], stiffness, limit, z, period)
    before = memory.set[i] - memory.own_velocity[i] * period
    reach = settings.exchange_slew[i] * period / stiffness if stiffness > 0.0 else math.inf
    low, high = before + min(0.0, moved) - reach - memory.set[i], before + max(0.0, moved) + reach - memory.set[i]
    velocity = min(max(0.0, high) / period, max(min(0.0, low) / period, wanted))
    force = min(limit, max(-limit, spring - stiffness * period * velocity)) + damping * (row.velocity[i] - velocity)
    outgoing = wave_variables.returned(incoming, force, velocity, z)
    memory.set[i] += velocity * period
    memory.sent[i] += outgoing * period
    memory.shipped += wave_variables.power(outgoing, z) * period
    memory.own_velocity[i] = velocity
    memory.set_velocity[i] = _damper_slewed(settings, memory, i, velocity)


@njit
def _felt_share(settings, memory):
    """Share 0…1 that the tank covers of the dampers' forces beyond those that the waves pay for."""
    force_square = 0.0
    for i in range(int(settings.axes)):
        beyond = memory.set_velocity[i] - memory.own_velocity[i]
        force = settings.scale[i] * memory.factor * settings.damping[i] * beyond
        if force != 0.0:
            force_square += force * force / max(0.0, settings.surplus[i])
    return set_position.damper_share(memory.tank - energy_tank.reserve(settings, memory), force_square, settings.period)


@njit
def _damper_slewed(settings, memory, i, wanted):
    """Next velocity at which the damper pulls: the wanted one, as far as the damper's share of the slew lets it."""
    damping = memory.factor * settings.damping[i]
    reach = (
        energy_tank.DAMPER_SLEW * settings.exchange_slew[i] * settings.period / damping if damping > 0.0 else math.inf
    )
    return min(memory.set_velocity[i] + reach, max(memory.set_velocity[i] - reach, wanted))


@njit
def _receive_waves(settings, memory, row):
    """Adds what has come since the last sample that counted to what is still to be played.

    It is played at the pace of the stamps, as late as the oldest sample of late: so an even stream stays even however
    unevenly it comes, and a ripple, which takes energy that was never sent, does not arise.
    """
    if row.tool_session != memory.tool_session:
        memory.tool_session, memory.tool_energy = row.tool_session, row.tool_energy
        for i in range(int(settings.axes)):
            memory.come[i], memory.pending[i] = row.tool_effort[i], 0.0
    back = exchange_samples.believed(row.tool_energy, memory.tool_energy, memory.shipped, memory.returned)
    memory.wave_store += back
    memory.returned += back
    memory.tool_energy = max(memory.tool_energy, row.tool_energy)
    memory.oldest = max(memory.oldest, row.tool_age)
    if row.tool_answered == memory.tool_answered:
        return
    memory.oldest = (
        max(row.tool_age, wave_variables.FORGET * memory.oldest) if memory.tool_answered > 0.0 else row.tool_age
    )
    memory.tool_answered = row.tool_answered
    time = max(settings.exchange_play, memory.oldest - row.tool_age)
    for i in range(int(settings.axes)):
        memory.pending[i] += row.tool_effort[i] - memory.come[i]
        memory.come[i] = row.tool_effort[i]
        memory.rate[i] = memory.pending[i] / time


@njit
def _play(settings, memory):
    """Fills in memory.wave; returns the share of these waves that energy received, and the tank, cover; spends it."""
    energy = 0.0
    for i in range(int(settings.axes)):
        reach = settings.exchange_slew[i] * settings.period
        rate = min(memory.wave[i] + reach, max(memory.wave[i] - reach, memory.rate[i]))
        memory.wave[i] = wave_variables.played(memory.pending[i], rate, settings.period)
        energy += (
            wave_variables.power(memory.wave[i], wave_variables.impedance(settings.stiffness[i])) * settings.period
        )
    spare = max(0.0, memory.tank - energy_tank.reserve(settings, memory))  # pays for the ripple of irregular samples
    share = wave_variables.covered(energy, memory.wave_store + spare)
    spent = min(memory.wave_store, share * share * energy)
    memory.wave_store -= spent
    memory.tank -= min(spare, share * share * energy - spent)
    return share


@njit
def _keep(settings, memory, row):
    """Axes the device does not have follow nothing."""
    for i in range(int(settings.axes), AXES):
        row.coupling_position[i], row.coupling_velocity[i] = row.tool_position[i], row.tool_velocity[i]
    row.exchange_tank, row.exchange_shortened = memory.tank, memory.shortened
    row.local, row.local_fallbacks, row.local_stays = memory.acting, memory.fallbacks, memory.stays + memory.unsolved
    row.local_pivots = memory.pivots
