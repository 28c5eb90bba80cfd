# SPDX-License-Identifier: Apache-2.0
"""The energy tank of the device's side, for whatever set position an exchange method wants (derivation: law/pspm).

It is filled by what the hand dissipates beyond what the gains need, and by what the spring lets go; it pays for what
the spring gains when the set position, or a factor on the spring, moves. One tank for all axes.
"""

import math

from haptic_device.kernel import kernel
from haptic_device.law import coupling, exchange, pspm


@kernel
def fill(settings, memory, row):
    """Books the hold that ends here (law/pspm, 1) and the energy that the other side sends back."""
    if not memory.filled:
        _start(settings, memory, row)
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
def _start(settings, memory, row):
    """The budget, and wave energy to begin with; where the handle is now, a window begins."""
    memory.filled, memory.tank, memory.wave_store = 1.0, settings.exchange_budget, 0.0
    memory.window_start = memory.latched_before = row.latched
    for i in range(int(settings.axes)):
        memory.window_from[i] = memory.midpoint[i] = memory.device_position[i]


@kernel
def _worth(settings, memory, i):
    """What ∫ v² dt fills in [N s/m]: b − c, and for pspm what the coupling's damper takes beside its bound."""
    if settings.exchange_method == exchange.WAVE:
        return max(0.0, settings.surplus[i])
    damper = 2.0 * memory.factor_held * settings.damping[i] * settings.scale[i] ** 2
    cancelled = settings.cancellation_ratio * settings.physical_damping[i]
    return max(0.0, settings.surplus[i]) + max(0.0, damper - cancelled)


@kernel
def pay(settings, memory, row):
    """Moves the set position towards the goal; the tank takes what the spring lets go and pays what it gains."""
    held, wanted, square = 0.0, 0.0, 0.0
    for i in range(int(settings.axes)):
        moved = settings.scale[i] * memory.moved[i]
        stretch = memory.set[i] - row.position[i]
        kept = coupling.spring_store(memory.spring[i], memory.clamp[i], stretch)
        if memory.mixed[i]:  # less was held than the spring says: what the hand may not have paid is not there
            kept = min(kept, coupling.spring_store(memory.spring[i], memory.clamp[i], stretch + moved))
        held += kept
        stiffness, limit = memory.factor * settings.stiffness[i], memory.factor * settings.coupling_limit[i]
        reach = settings.exchange_slew[i] * settings.period / stiffness if stiffness > 0.0 else math.inf
        goal = memory.goal[i] if row.exchange_fade > 0.0 else row.position[i]
        stretch = pspm.slewed(memory.set[i], goal, moved, reach) - row.position[i]
        memory.stretch[i] = stretch
        wanted += coupling.spring_store(stiffness, limit, stretch)
        square += 0.5 * stiffness * stretch * stretch
    share = pspm.share_paid(held + max(0.0, memory.tank), wanted, square)  # a debt costs no stretch that is there
    memory.shortened += 1.0 if share < 1.0 else 0.0
    memory.tank += held
    for i in range(int(settings.axes)):
        stiffness, limit = memory.factor * settings.stiffness[i], memory.factor * settings.coupling_limit[i]
        stretch = share * memory.stretch[i]
        memory.tank -= coupling.spring_store(stiffness, limit, stretch)
        before, memory.set[i] = memory.set[i], row.position[i] + stretch
        memory.own_velocity[i] = (memory.set[i] - before) / settings.period
        memory.spring[i], memory.clamp[i] = stiffness, limit


@kernel
def take_returned(settings, memory, row):
    """Energy that the simulation's side sends back, never more than was shipped there."""
    if row.tool_session != memory.tool_session:
        memory.tool_session, memory.tool_energy = row.tool_session, row.tool_energy
    back = exchange.believed(row.tool_energy, memory.tool_energy, memory.shipped, memory.returned)
    memory.tank = max(memory.tank, min(settings.exchange_tank, memory.tank + back))  # what is over is not sent again
    memory.returned += back
    memory.tool_energy = max(memory.tool_energy, row.tool_energy)
