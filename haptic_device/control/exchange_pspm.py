# SPDX-License-Identifier: Apache-2.0
"""Exchange method `pspm`: passive set-position modulation after the tool's samples (control/set_position)."""

from haptic_device.control import energy_tank, set_position
from haptic_device.jit import kernel, njit


@kernel
def move_set_point(settings, tank, spring, motion, tool, output):
    """Set position after the tool's samples, as far as slew and tank allow (set_position, 2)."""
    energy_tank.take_returned(settings, tank, tool)
    for i in range(int(settings.axes)):
        spring.goal[i] = _predicted(settings, motion, tool, i)
    energy_tank.pay(settings, tank, spring, motion, output.exchange_fade)
    worst = damped = 0.0
    for i in range(int(settings.axes)):
        # never faster than the tool is said to be, nor than the set position really moves
        most, least = max(0.0, tool.velocity[i]), min(0.0, tool.velocity[i])
        wanted, damping = min(most, max(least, spring.own_velocity[i])), spring.factor * settings.coupling.damping[i]
        # the damper pulls after it within its own share of the slew
        slew = settings.exchange.slew[i]
        velocity = set_position.slewed_velocity(spring.set_velocity[i], wanted, damping, slew, settings.period)
        spring.set_velocity[i] = velocity
        worst += energy_tank.worst_draw(settings, tank, i, damping * velocity)
        damped += energy_tank.damped_draw(settings, tank, i, damping * velocity)
    share = set_position.damper_share(tank.level - energy_tank.reserve(settings, tank, spring), worst, damped)
    for i in range(int(settings.axes)):
        if share < 1.0:
            unpaid = (1.0 - share) * spring.factor * settings.coupling.damping[i] * spring.set_velocity[i]
            energy_tank.note_unpaid(settings, tank, i, unpaid)
        spring.set_velocity[i] *= share
        output.coupling_position[i], output.coupling_velocity[i] = spring.set_position[i], spring.set_velocity[i]
    # what is over is the simulation's to use: it comes back at most once
    if tank.level > settings.exchange.tank:
        tank.shipped += tank.level - settings.exchange.tank
        tank.level = settings.exchange.tank
    output.exchange_energy = tank.shipped


@njit
def _predicted(settings, motion, tool, i):
    """Where the tool is now, in contact or free [m | rad]."""
    chosen, stiffness = settings.exchange, settings.coupling.stiffness[i]
    straight = set_position.predicted_position(tool.position[i], tool.velocity[i], tool.age, chosen.horizon)
    if tool.contact > 0.0 or stiffness <= 0.0:
        return straight
    age, stretch = max(0.0, min(tool.age, chosen.horizon)), tool.effort[i] / stiffness
    trust, agility = _trust(settings, i), chosen.agility[i]
    return set_position.predicted_beside_handle(straight, motion.handle[i], stretch, age, agility, trust)


@njit
def _trust(settings, i):
    """Age [s] at which half of a free tool's force is believed: (2 b + B)/K, of what of b is not cancelled."""
    # in the world: b counts scale² there
    left = (1.0 - settings.cancellation.ratio) * settings.hardware.damping[i] / settings.hardware.scale[i] ** 2
    return max(0.0, 2.0 * left + settings.coupling.damping[i]) / settings.coupling.stiffness[i]
