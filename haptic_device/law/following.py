# SPDX-License-Identifier: Apache-2.0
"""What the coupling pulls to: the tool's samples, by the exchange method that is set. A part of the servo's tick.

Energies are of all axes together; the tank is filled and paid as law/pspm has it, the port as law/wave has it. Every
factor on the coupling's force (engaging, fading) multiplies its spring, so that its rise is paid as a jump is.
"""

import math

from haptic_device.kernel import kernel
from haptic_device.law import coupling, engage, exchange, pspm, wave

AXES = 3
DAMPER_SLEW = 0.25  # share of the slew that the set position's velocity may make on top of it
CORRECTION = 2.0  # [1/s] at which the wave method's port is led back to where the tool is


@kernel
def follow(settings, memory, row):
    """Fills in coupling_position, coupling_velocity, exchange_fade, exchange_energy and exchange_effort of the row."""
    hold, fade = settings.exchange_hold, settings.exchange_fade
    memory.exchange_fade = exchange.fade_factor(memory.exchange_fade, row.tool_age, settings.period, hold, fade)
    row.exchange_fade = memory.exchange_fade
    if settings.exchange_method == exchange.DIRECT:
        _as_it_is(row)
        return
    risen = engage.engage_factor(int(memory.state), memory.engage, settings.period, settings.engage_time)
    memory.factor = risen * row.exchange_fade
    _fill_tank(settings, memory, row)
    if settings.exchange_method == exchange.PSPM:
        _modulate(settings, memory, row)
    else:
        _take_waves(settings, memory, row)
    _keep(settings, memory, row)


@kernel
def settle(settings, memory, row):
    """At the end of the tick: what the coupling's spring really holds; a rise that was not foreseen is still paid."""
    factor = row.engage * row.exchange_fade
    modulated = 1.0 if settings.exchange_method == exchange.PSPM else 0.0  # waves pay for their own velocity
    for i in range(int(settings.axes)):
        stiffness, limit = factor * settings.stiffness[i], factor * settings.coupling_limit[i]
        if factor > memory.factor:
            stretch = row.coupling_position[i] - row.position[i]
            memory.tank -= coupling.spring_store(stiffness, limit, stretch)
            memory.tank += coupling.spring_store(memory.spring[i], memory.clamp[i], stretch)
        memory.spring[i], memory.clamp[i] = stiffness, limit
        memory.push[i] = modulated * factor * settings.damping[i] * row.coupling_velocity[i]
    memory.factor = factor


@kernel
def _as_it_is(row):
    for i in range(AXES):
        row.coupling_position[i], row.coupling_velocity[i] = row.tool_position[i], row.tool_velocity[i]


@kernel
def _fill_tank(settings, memory, row):
    """Books the hold that ends here (law/pspm, 1) and the energy that the other side sends back."""
    if not memory.filled:
        _fill_first(settings, memory, row)
    fresh = memory.window_holds >= pspm.WINDOW
    memory.window_holds = 1.0 if fresh else memory.window_holds + 1.0
    for i in range(int(settings.axes)):
        moved, scale = memory.moved[i], settings.scale[i]
        memory.tank -= memory.push[i] * scale * moved
        if fresh:
            memory.window_from[i], memory.counted[i] = memory.midpoint[i], 0.0
        memory.midpoint[i] = memory.device_position[i] - 0.5 * moved
    if fresh:
        memory.window_start = memory.latched_before
    elapsed = (row.latched - memory.window_start) * 1e-9
    for i in range(int(settings.axes)):
        way, step = memory.midpoint[i] - memory.window_from[i], abs(settings.position_per_count[i])
        counted = pspm.dissipated(memory.counted[i], way, step, elapsed)
        memory.tank += _worth(settings, memory, i) * (counted - memory.counted[i])
        memory.counted[i] = counted
    memory.latched_before, memory.factor_held = row.latched, memory.factor


@kernel
def _fill_first(settings, memory, row):
    """The budget, and wave energy to begin with; where the handle is now, a window begins."""
    memory.filled, memory.tank, memory.wave_store = 1.0, settings.exchange_budget, 0.0
    memory.window_start = memory.latched_before = row.latched
    for i in range(int(settings.axes)):
        memory.window_from[i] = memory.midpoint[i] = memory.device_position[i]


@kernel
def _worth(settings, memory, i):
    """What ∫ v² dt fills into the tank [N s/m]: b − c, and for pspm what the coupling's damper takes beside its bound."""
    if settings.exchange_method == exchange.WAVE:
        return max(0.0, settings.surplus[i])
    damper = 2.0 * memory.factor_held * settings.damping[i] * settings.scale[i] ** 2
    cancelled = settings.cancellation_ratio * settings.physical_damping[i]
    return max(0.0, settings.surplus[i]) + max(0.0, damper - cancelled)


@kernel
def _modulate(settings, memory, row):
    """Set position after the tool's samples, foretold, as far as slew and tank allow (law/pspm, 2)."""
    _take_returned(settings, memory, row)
    for i in range(int(settings.axes)):
        memory.goal[i] = _foretold(settings, row, i)
    _accept(settings, memory, row)
    force_square = 0.0
    for i in range(int(settings.axes)):
        own = memory.own_velocity[i]
        most, least = max(0.0, row.tool_velocity[i]), min(0.0, row.tool_velocity[i])
        wanted = min(most, max(least, own))
        damping = memory.factor * settings.damping[i]
        reach = DAMPER_SLEW * settings.exchange_slew[i] * settings.period / damping if damping > 0.0 else math.inf
        velocity = min(memory.set_velocity[i] + reach, max(memory.set_velocity[i] - reach, wanted))
        memory.set_velocity[i] = velocity
        force = settings.scale[i] * damping * velocity
        if force != 0.0:
            force_square += force * force / max(0.0, settings.surplus[i])
    share = pspm.damper_share(memory.tank, force_square, settings.period)
    for i in range(int(settings.axes)):
        memory.set_velocity[i] *= share
        row.coupling_position[i], row.coupling_velocity[i] = memory.set[i], memory.set_velocity[i]
        row.exchange_effort[i] = 0.0
    if memory.tank > settings.exchange_tank:
        memory.shipped += memory.tank - settings.exchange_tank
        memory.tank = settings.exchange_tank
    row.exchange_energy = memory.shipped


@kernel
def _foretold(settings, row, i):
    """Where the tool is now, in contact or free [m | rad]."""
    position, velocity, age = row.tool_position[i], row.tool_velocity[i], row.tool_age
    straight = pspm.foretold(position, velocity, age, settings.exchange_horizon)
    if row.tool_contact > 0.0 or settings.stiffness[i] <= 0.0:
        return straight
    stretch = row.tool_effort[i] / settings.stiffness[i]
    age = max(0.0, min(age, settings.exchange_horizon))
    return pspm.beside(straight, row.position[i], stretch, age, settings.exchange_agility[i])


@kernel
def _accept(settings, memory, row):
    """Moves the set position towards the goal; the tank takes what the spring lets go and pays what it gains."""
    available, wanted, square = memory.tank, 0.0, 0.0
    for i in range(int(settings.axes)):
        moved = settings.scale[i] * memory.moved[i]
        stretch = memory.set[i] - row.position[i]
        held = coupling.spring_store(memory.spring[i], memory.clamp[i], stretch)
        if memory.limited[i]:  # less was held than the spring says: what the hand may not have paid is not there
            held = min(held, coupling.spring_store(memory.spring[i], memory.clamp[i], stretch + moved))
        available += held
        stiffness, limit = memory.factor * settings.stiffness[i], memory.factor * settings.coupling_limit[i]
        reach = settings.exchange_slew[i] * settings.period / stiffness if stiffness > 0.0 else math.inf
        goal = memory.goal[i] if row.exchange_fade > 0.0 else row.position[i]
        stretch = pspm.slewed(memory.set[i], goal, moved, reach) - row.position[i]
        memory.stretch[i] = stretch
        wanted += coupling.spring_store(stiffness, limit, stretch)
        square += 0.5 * stiffness * stretch * stretch
    share = pspm.share_paid(available, wanted, square)
    memory.shortened += 1.0 if share < 1.0 else 0.0
    memory.tank = available
    for i in range(int(settings.axes)):
        stiffness, limit = memory.factor * settings.stiffness[i], memory.factor * settings.coupling_limit[i]
        stretch = share * memory.stretch[i]
        memory.tank -= coupling.spring_store(stiffness, limit, stretch)
        before, memory.set[i] = memory.set[i], row.position[i] + stretch
        memory.own_velocity[i] = (memory.set[i] - before) / settings.period
        memory.spring[i], memory.clamp[i] = stiffness, limit


@kernel
def _take_returned(settings, memory, row):
    """Energy that the simulation's side sends back, never more than was shipped there."""
    if row.tool_session != memory.tool_session:
        memory.tool_session, memory.tool_energy = row.tool_session, row.tool_energy
    back = exchange.believed(row.tool_energy, memory.tool_energy, memory.shipped, memory.returned)
    memory.tank = max(memory.tank, min(settings.exchange_tank, memory.tank + back))  # what is over is not sent again
    memory.returned += back
    memory.tool_energy = max(memory.tool_energy, row.tool_energy)


@kernel
def _take_waves(settings, memory, row):
    """Port behind the coupling that the waves from the tool move, and the waves it sends back (law/wave)."""
    _receive_waves(settings, memory, row)
    for i in range(int(settings.axes)):
        tool = pspm.foretold(row.tool_position[i], row.tool_velocity[i], row.tool_age, settings.exchange_horizon)
        memory.goal[i] = memory.set[i] + CORRECTION * settings.period * (tool - memory.set[i])
    _accept(settings, memory, row)
    memory.tank = min(memory.tank, settings.exchange_tank)
    share = _play(settings, memory)
    for i in range(int(settings.axes)):
        incoming = share * memory.wave[i]
        memory.pending[i] -= incoming * settings.period
        stiffness, limit = memory.spring[i], memory.clamp[i]
        damping, z = memory.factor * settings.damping[i], wave.impedance(settings.stiffness[i])
        spring = stiffness * (row.position[i] - memory.set[i])
        velocity = wave.port_velocity(
            incoming, spring, damping, row.velocity[i], stiffness, limit, z, settings.period
        )
        memory.set[i] += velocity * settings.period
        outgoing = incoming + 2.0 * z * velocity
        memory.sent[i] += outgoing * settings.period
        memory.shipped += wave.power(outgoing, z) * settings.period
        row.coupling_position[i], row.coupling_velocity[i] = memory.set[i], velocity
        row.exchange_effort[i] = memory.sent[i]
    row.exchange_energy = memory.shipped


@kernel
def _receive_waves(settings, memory, row):
    """Adds what has come since the last sample that counted to what is still to be played."""
    if row.tool_session != memory.tool_session:
        memory.tool_session, memory.tool_energy = row.tool_session, row.tool_energy
        for i in range(int(settings.axes)):
            memory.come[i], memory.pending[i] = row.tool_effort[i], 0.0
    back = exchange.believed(row.tool_energy, memory.tool_energy, memory.shipped, memory.returned)
    memory.wave_store += back
    memory.returned += back
    memory.tool_energy = max(memory.tool_energy, row.tool_energy)
    if row.tool_answered == memory.tool_answered:
        return
    memory.tool_answered = row.tool_answered
    for i in range(int(settings.axes)):
        memory.pending[i] += row.tool_effort[i] - memory.come[i]
        memory.come[i] = row.tool_effort[i]
        memory.rate[i] = memory.pending[i] / settings.exchange_play


@kernel
def _play(settings, memory):
    """Waves of this tick, into memory.wave; returns the share of them that the energy received covers, and spends it."""
    energy = 0.0
    for i in range(int(settings.axes)):
        memory.wave[i] = wave.played(memory.pending[i], memory.rate[i], settings.period)
        energy += wave.power(memory.wave[i], wave.impedance(settings.stiffness[i])) * settings.period
    share = wave.covered(energy, memory.wave_store)
    memory.wave_store = max(0.0, memory.wave_store - share * share * energy)
    return share


@kernel
def _keep(settings, memory, row):
    """Axes the device does not have follow nothing."""
    for i in range(int(settings.axes), AXES):
        row.coupling_position[i], row.coupling_velocity[i] = row.tool_position[i], row.tool_velocity[i]
    row.exchange_tank, row.exchange_shortened = memory.tank, memory.shortened
