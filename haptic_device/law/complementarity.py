# SPDX-License-Identifier: Apache-2.0
"""Contacts with Coulomb friction on one planar body, solved exactly by pivoting: three unknowns, whatever touches.

    A v = r + Gᵀ λ,     w = G v + b + E λ,     0 ≤ λ_n ⟂ w_n ≥ 0,     |λ_t| ≤ μ λ_n against w_t                (1)

v is the velocity at the end of the tick (3), A its effective mass, λ impulses, b what else the gap's rate has, and E a
diagonal of compliances: of the contact itself and of the body behind it. A guess of each contact's mode turns (1) into

    (A + Σ Gᵀ E⁻¹ G) v = r − Σ Gᵀ E⁻¹ b           over what is closed; a sliding λ_t = ± μ λ_n is carried along

three equations whose solution says which modes were wrong. All wrong ones change at once while their number falls, then
only the last (principal pivoting after Murty and Júdice & Pires). A mode guess is the last tick's, so that mostly one
solution is enough. The number of pivots is bounded; without an answer the caller has a passive one: v = 0.

Where the friction of (1) has several solutions any of them is taken; E > 0 excludes none that matters: at 1e-8 m/N a
force of 20 N is 0.2 µm.
"""

from haptic_device.kernel import kernel

PIVOTS = 16  # at most
PATIENCE = 6  # solutions for which all wrong modes may change at once without their number falling
UNUSED, OPEN, STICK, UP, DOWN = -1.0, 0.0, 1.0, 2.0, 3.0  # UP, DOWN: sliding, friction at its upper, lower bound
N_X, N_Y, N_TURN, T_X, T_Y, T_TURN, B_N, B_T, E_N, E_T, MU, MODE, IMPULSE, SLIP_IMPULSE = range(14)
COLUMNS = 14
ROUNDING = 1e-9


@kernel
def solve(rows, mass, right, system, velocity):
    """Velocity (3) of (1), and the impulses in rows; returns the solutions it took, or −1.

    rows: (contacts, COLUMNS); mass, right: (3) A and r; system: (3, 4) to work in.
    """
    fewest, patience = 2 * rows.shape[0] + 1, PATIENCE
    for turn in range(PIVOTS):
        _assemble(rows, mass, right, system)
        if not _eliminate(system, velocity):
            return -1
        wrong, last = _review(rows, velocity, patience > 0)
        if wrong == 0:
            return turn + 1
        if patience <= 0:
            rows[last, MODE] = _wished(rows[last], velocity)
        elif wrong < fewest:
            fewest, patience = wrong, PATIENCE
        else:
            patience -= 1
    return -1


@kernel
def _assemble(rows, mass, right, system):
    for i in range(3):
        for k in range(3):
            system[i, k] = 0.0
        system[i, i], system[i, 3] = mass[i], right[i]
    for one in rows:
        if one[MODE] <= OPEN:
            continue
        stiff = 1.0 / one[E_N]
        sense = one[MU] if one[MODE] == UP else (-one[MU] if one[MODE] == DOWN else 0.0)
        for i in range(3):
            pushed = stiff * (one[N_X + i] + sense * one[T_X + i])
            system[i, 3] -= pushed * one[B_N]
            for k in range(3):
                system[i, k] += pushed * one[N_X + k]
        if one[MODE] == STICK and one[MU] > 0.0:
            grip = 1.0 / one[E_T]
            for i in range(3):
                system[i, 3] -= grip * one[T_X + i] * one[B_T]
                for k in range(3):
                    system[i, k] += grip * one[T_X + i] * one[T_X + k]


@kernel
def _eliminate(system, velocity):
    """Solves the three equations, each scaled by its diagonal; False if they are singular."""
    for i in range(3):
        scale = 1.0 / system[i, i] if system[i, i] > 0.0 else 1.0
        for k in range(4):
            system[i, k] *= scale
    for i in range(3):
        at = i
        for k in range(i + 1, 3):
            if abs(system[k, i]) > abs(system[at, i]):
                at = k
        if system[at, i] == 0.0:
            return False
        for k in range(4):
            system[i, k], system[at, k] = system[at, k], system[i, k]
        for k in range(i + 1, 3):
            share = system[k, i] / system[i, i]
            for c in range(i, 4):
                system[k, c] -= share * system[i, c]
    for i in range(2, -1, -1):
        total = system[i, 3]
        for k in range(i + 1, 3):
            total -= system[i, k] * velocity[k]
        velocity[i] = total / system[i, i]
    return abs(velocity[0]) + abs(velocity[1]) + abs(velocity[2]) < 1e12


@kernel
def _review(rows, velocity, change):
    """Impulses of this solution; number and last of the modes it contradicts, which change if they may."""
    wrong, last = 0, -1
    for r in range(rows.shape[0]):
        one = rows[r]
        if one[MODE] == UNUSED:
            continue
        wish = _wished(one, velocity)
        if wish != one[MODE]:
            wrong, last = wrong + 1, r
            if change:
                one[MODE] = wish
    return wrong, last


@kernel
def _wished(one, velocity):
    """The mode that this solution asks for; notes its impulses."""
    rate, slip, size = one[B_N], one[B_T], abs(one[B_N])
    for i in range(3):
        rate += one[N_X + i] * velocity[i]
        slip += one[T_X + i] * velocity[i]
        size += abs(one[N_X + i] * velocity[i])
    mode = one[MODE]
    one[IMPULSE], one[SLIP_IMPULSE] = 0.0, 0.0
    if mode == OPEN:
        return STICK if rate < -ROUNDING * size else OPEN
    one[IMPULSE] = -rate / one[E_N]
    if one[IMPULSE] < 0.0:
        return OPEN
    if one[MU] == 0.0:
        return mode
    most = one[MU] * one[IMPULSE]
    if mode == STICK:
        one[SLIP_IMPULSE] = -slip / one[E_T]
        if abs(one[SLIP_IMPULSE]) <= most * (1.0 + ROUNDING):
            return STICK
        return UP if one[SLIP_IMPULSE] > 0.0 else DOWN
    one[SLIP_IMPULSE] = most if mode == UP else -most
    against = slip if mode == UP else -slip
    return STICK if against > ROUNDING * size else mode
