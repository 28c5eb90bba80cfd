# SPDX-License-Identifier: Apache-2.0
"""Exchange methods `pspm` and `direct`: the coupling is wished for where the tool is, as far as the slew allows.

`pspm` (control/set_position) foretells where that is now; `direct` takes the last sample as it is.
"""

import math

from haptic_device.control import exchange_samples, set_position
from haptic_device.jit import kernel, njit


@kernel
def wish(settings, state, tool, output):
    """Fills in the output's set position and its velocity."""
    motion, coupling, direct = state.motion, state.coupling, settings.exchange.method == exchange_samples.DIRECT
    for i in range(int(settings.axes)):
        row, slew = state.rows[i], settings.exchange.slew[i]
        held = row.weight > 0.0 and row.stiffness > 0.0
        reach = slew * settings.period / (row.weight * row.stiffness) if held else math.inf
        goal = tool.position[i] if direct else _predicted(settings, motion, tool, i)
        moved = settings.hardware.scale[i] * motion.moved[i]
        place = set_position.slewed(row.offset, goal, moved, reach)
        own = (place - row.offset) / settings.period
        # never faster than the tool is said to be, nor than the set position really moves
        most, least = max(0.0, tool.velocity[i]), min(0.0, tool.velocity[i])
        velocity = tool.velocity[i] if direct else min(most, max(least, own))
        damping = row.weight * row.damping
        # the damper pulls after it within its own share of the slew
        velocity = set_position.slewed_velocity(coupling.set_velocity[i], velocity, damping, slew, settings.period)
        output.coupling_position[i], output.coupling_velocity[i] = place, velocity


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
