# SPDX-License-Identifier: Apache-2.0
"""What a change of settings may cost: the ledger that pays for it, and steps towards what is wished for."""

from haptic_device.control import energy_tank, exchange_samples
from haptic_device.jit import kernel


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
    return max(0.0, state.tank.level - energy_tank.reserve(now, state.tank, state.spring))


@kernel
def share(available, cost):
    """Share 0…1 of a cost [J] that is there."""
    return 1.0 if cost <= available else available / cost


@kernel
def pay(now, state, energy, along_x, along_y):
    """Takes this energy [J] from the ledger; the observer counts it as generated, by axis."""
    state.observer.by_settings[0] += along_x * energy
    state.observer.by_settings[1] += along_y * energy
    if now.exchange.method != exchange_samples.DIRECT:
        state.tank.level -= energy
