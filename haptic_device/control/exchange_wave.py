# SPDX-License-Identifier: Apache-2.0
"""Exchange method `wave`: wave variables between coupling and tool.

Niemeyer & Slotine 1991; Stramigioli et al. 2002 for the sampled port.

The port: force u on the tool and its backward-difference velocity v, impedance z. With p = u + z v (towards the tool)
and q = u − z v (back), the power into the tool is u v = (p² − q²)/4z, exactly also for the sampled port: the wave that
comes back holds energy only if it was sent. What is carried is not the wave but two sums since the sender's start,

    the integral Σ p T [N s] of each axis, and the energy Σ p² T/4z [J] of all axes,

so that lost, late, repeated and reordered samples lose nothing. The receiver plays out what has come as waves of its
own: `played` empties the integral at a steady rate, `covered` keeps their energy within what has come and what the tank
adds. An integral kept whole is a position kept whole; what energy did not cover is dropped and the port led back to the
tool: no drift. A held wave would create energy, a sum played once cannot.

A message's energy is believed only up to what this side itself has sent (and a budget): then, whatever comes, the
energy out of the port stays below the energy into it, and with b > KT/2 + B the display is passive (Colgate 1995,
eq. 3), the port being the passive environment that the equation asks for.
"""

import math

from haptic_device.control import energy_accounting, energy_tank, exchange_samples, set_position
from haptic_device.jit import kernel, njit

CORRECTION = 2.0  # [1/s] at which the port is led back to where the tool is
IMPEDANCE_TIME = 0.004  # [s] z = K · this: the line is as stiff as the coupling at a delay of this length
FORGET = 0.99995  # from sample to sample, of the oldest that one of late became before the next came
LEAST = 1e-3  # [N s/m] impedance where there is no stiffness


@kernel
def impedance(stiffness):
    """Wave impedance z [N s/m | N m s/rad], from the stiffness which both sides know."""
    return max(LEAST, IMPEDANCE_TIME * stiffness)


@kernel
def played(pending, rate, period):
    """Wave [N] of this period: the rate set when the last sample came, as long as the pending integral [N s] lasts.

    A rate that followed the pending integral would ripple, and a ripple needs more energy than what was sent.
    """
    most = pending / period
    return min(max(0.0, most), max(min(0.0, most), rate))


@kernel
def power(wave, impedance):
    """Power [W] that a wave carries."""
    return wave * wave / (4.0 * impedance)


@kernel
def covered(energy, store):
    """Share 0…1 of all waves of a tick whose energy [J] is covered by the store of energy that has come."""
    if energy <= store:
        return 1.0
    return math.sqrt(store / energy) if store > 0.0 else 0.0


@kernel
def port_velocity(incoming, spring, damping, rate, stiffness, limit, impedance, period):
    """Velocity of the port behind the coupling for an incoming wave q: u − z v = q solved with the coupling's force.

    u = clamp(spring − K T v) + B (rate − v); spring: K (x − y) before this tick's motion [N], rate: the handle's.
    """
    velocity = (spring + damping * rate - incoming) / (impedance + stiffness * period + damping)
    force = spring - stiffness * period * velocity
    if abs(force) > limit:
        velocity = (math.copysign(limit, force) + damping * rate - incoming) / (impedance + damping)
    return velocity


@kernel
def returned(incoming, force, velocity, impedance):
    """Wave [N] that goes back from a port with this force and velocity: u + z v, with no more energy than came in.

    Where u − z v is the incoming wave that is u v + q²/4z exactly. A port that is held back to a part of that velocity
    (between 0 and it) has not less: u falls as v grows, so u v ≥ 0 or u v is nearer 0 than it was.
    """
    natural = force + impedance * velocity
    most = math.sqrt(max(0.0, 4.0 * impedance * force * velocity + incoming * incoming))
    return math.copysign(min(abs(natural), most), natural)


@kernel
def hold_ended(settings, tank, spring, hold, motion, enable, sensors):
    """Books the hold; the coupling's damper pays for its own port, so that only b − c fills the tank."""
    energy_accounting.hold_ended(settings, tank, spring, hold, motion, enable, sensors, False)


@kernel
def move_set_point(settings, waves, tank, spring, motion, tool, output):
    """Port behind the coupling that the waves from the tool move, and the waves it sends back."""
    _receive(settings, waves, tank, tool)
    for i in range(int(settings.axes)):
        there = _tool_place(settings, tool, i)
        spring.goal[i] = spring.set_position[i] + CORRECTION * settings.period * (there - spring.set_position[i])
    if energy_tank.pay(settings, tank, spring, motion, output.exchange_fade):
        for i in range(int(settings.axes)):
            energy_tank.note_kept_short(settings, tank, spring, motion, i, _tool_place(settings, tool, i))
    tank.level = min(tank.level, settings.exchange.tank)
    share = _play(settings, waves, tank, spring)
    for i in range(int(settings.axes)):
        incoming = share * waves.wave[i]
        if share < 1.0:
            energy_tank.note_unpaid(settings, tank, i, waves.wave[i] - incoming)
        waves.pending[i] -= waves.wave[i] * settings.period  # what energy does not cover is dropped, or it grows
        _move_port(settings, waves, tank, spring, motion, output, i, incoming)
    share = _felt_share(settings, tank, spring)
    for i in range(int(settings.axes)):
        port = spring.own_velocity[i]
        beyond = spring.set_velocity[i] - port
        if share < 1.0:
            unpaid = (1.0 - share) * spring.factor * settings.coupling.damping[i] * beyond
            energy_tank.note_unpaid(settings, tank, i, unpaid)
        spring.set_velocity[i] = port + share * beyond
        output.coupling_position[i], output.coupling_velocity[i] = spring.set_position[i], spring.set_velocity[i]
        output.exchange_effort[i] = waves.sent[i]
    output.exchange_energy = tank.shipped


@kernel
def tick_ended(settings, tank, spring, motion, output):
    """The spring that is held; waves pay for their port's velocity. The handle sample carries the waves."""
    energy_tank.tick_ended(settings, tank, spring, motion, output, spring.own_velocity)


@njit
def _tool_place(settings, tool, i):
    """Where the tool is now, to first order [m | rad]."""
    horizon = settings.exchange.horizon
    return set_position.predicted_position(tool.position[i], tool.velocity[i], tool.age, horizon)


@njit
def _receive(settings, waves, tank, tool):
    """Adds what has come since the last sample that counted to what is still to be played.

    It is played at the pace of the stamps, as late as the oldest sample of late: so an even stream stays even however
    unevenly it comes, and a ripple, which takes energy that was never sent, does not arise.
    """
    if tool.session != tank.tool_session:
        tank.tool_session, tank.tool_energy = tool.session, tool.energy
        for i in range(int(settings.axes)):
            waves.received[i], waves.pending[i] = tool.effort[i], 0.0
    back = exchange_samples.believed(tool.energy, tank.tool_energy, tank.shipped, tank.returned)
    waves.store += back
    tank.returned += back
    tank.tool_energy = max(tank.tool_energy, tool.energy)
    waves.oldest = max(waves.oldest, tool.age)
    if tool.answered == waves.answered:
        return
    waves.oldest = max(tool.age, FORGET * waves.oldest) if waves.answered > 0.0 else tool.age
    waves.answered = tool.answered
    time = max(settings.exchange.play, waves.oldest - tool.age)
    for i in range(int(settings.axes)):
        waves.pending[i] += tool.effort[i] - waves.received[i]
        waves.received[i] = tool.effort[i]
        waves.rate[i] = waves.pending[i] / time


@njit
def _play(settings, waves, tank, spring):
    """Fills in the waves; returns the share of them that energy received, and the tank, cover; spends it."""
    energy = 0.0
    for i in range(int(settings.axes)):
        reach = settings.exchange.slew[i] * settings.period
        rate = min(waves.wave[i] + reach, max(waves.wave[i] - reach, waves.rate[i]))
        waves.wave[i] = played(waves.pending[i], rate, settings.period)
        energy += power(waves.wave[i], impedance(settings.coupling.stiffness[i])) * settings.period
    # the tank pays for the ripple of irregular samples
    spare = max(0.0, tank.level - energy_tank.reserve(settings, tank, spring))
    # waves are energy that has come; what is missing the tank adds, or they are played smaller
    share = covered(energy, waves.store + spare)
    spent = min(waves.store, share * share * energy)
    waves.store -= spent
    tank.level -= min(spare, share * share * energy - spent)
    return share


@njit
def _move_port(settings, waves, tank, spring, motion, output, i, incoming):
    """Port of axis i for an incoming wave, as fast as the slew lets the spring change; and the wave that goes back.

    The damper's force on the handle changes by its own slew; the tank pays for what lies between.
    """
    stiffness, limit, moved = spring.stiffness[i], spring.limit[i], settings.hardware.scale[i] * motion.moved[i]
    damping, z = spring.factor * settings.coupling.damping[i], impedance(settings.coupling.stiffness[i])
    period, rate, slew = settings.period, output.velocity[i], settings.exchange.slew[i]
    pull = stiffness * (motion.handle[i] - spring.set_position[i])
    wanted = port_velocity(incoming, pull, damping, rate, stiffness, limit, z, period)
    before = spring.set_position[i] - spring.own_velocity[i] * period
    reach = slew * period / stiffness if stiffness > 0.0 else math.inf
    low = before + min(0.0, moved) - reach - spring.set_position[i]
    high = before + max(0.0, moved) + reach - spring.set_position[i]
    # towards the wanted one, never past it: u v ≥ 0 then, or nearer 0 than it was
    velocity = min(max(0.0, high) / period, max(min(0.0, low) / period, wanted))
    force = min(limit, max(-limit, pull - stiffness * period * velocity)) + damping * (rate - velocity)
    outgoing = returned(incoming, force, velocity, z)
    spring.set_position[i] += velocity * period
    waves.sent[i] += outgoing * period
    tank.shipped += power(outgoing, z) * period
    spring.own_velocity[i] = velocity
    spring.set_velocity[i] = set_position.slewed_velocity(spring.set_velocity[i], velocity, damping, slew, period)


@njit
def _felt_share(settings, tank, spring):
    """Share 0…1 that the tank covers of the dampers' forces beyond those that the waves pay for."""
    worst = damped = 0.0
    for i in range(int(settings.axes)):
        force = spring.factor * settings.coupling.damping[i] * (spring.set_velocity[i] - spring.own_velocity[i])
        worst += energy_tank.worst_draw(settings, tank, i, force)
        damped += energy_tank.damped_draw(settings, tank, i, force)
    return set_position.damper_share(tank.level - energy_tank.reserve(settings, tank, spring), worst, damped)
