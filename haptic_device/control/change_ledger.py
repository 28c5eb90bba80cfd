# SPDX-License-Identifier: Apache-2.0
"""What a change of settings may cost: the ledger that pays for it, and steps towards what is wished for."""

from haptic_device.control import energy_tank, exchange_samples
from haptic_device.jit import kernel, njit


@kernel
def aim(value, wished, falling):
    return min(value, wished) if falling else wished


@kernel
def toward(value, wished, reach):
    return min(value + reach, max(value - reach, wished))


@kernel
def available(now, state):
    """Energy [J] that may be spent on what changes the force."""
    if now.exchange.method == exchange_samples.DIRECT:
        spent = 0.0
        for i in range(state.observer.observed_energy.size):
            spent += state.observer.observed_energy[i] + state.observer.by_settings[i]
        return max(0.0, now.exchange.budget + now.passivity.budget - spent)
    kept = energy_tank.reserve(now, state.tank, state.spring) + _promised(now, state)
    return max(0.0, state.tank.level - kept)


@njit
def _promised(now, state):
    """Energy [J] that the damper's push may draw in the hold that is being booked or begun."""
    energy = 0.0
    for i in range(int(now.axes)):
        push = state.spring.factor * now.coupling.damping[i] * state.spring.set_velocity[i]
        energy += energy_tank.worst_draw(now, state.tank, i, push)
    return energy


@kernel
def share(available, cost):
    """Share 0…1 of a cost [J] that is there."""
    return 1.0 if cost <= available else available / cost


@kernel
def pay(now, state, energy, i):
    """Takes this energy [J] of axis i from the ledger; the observer counts it as generated."""
    state.observer.by_settings[i] += energy
    if now.exchange.method != exchange_samples.DIRECT:
        state.tank.level -= energy
        state.tank.given += energy  # walls and dampers may give it


@kernel
def pay_along(now, state, energy, nx, ny):
    """The same for what acts along a normal in the plane."""
    pay(now, state, nx * nx * energy, 0)
    pay(now, state, ny * ny * energy, 1)
