# SPDX-License-Identifier: Apache-2.0
"""Contacts with Coulomb friction on one planar body, solved exactly by pivoting: three unknowns, whatever touches.

    A v = r + Gᵀ λ,     w = G v + b + E λ,     0 ≤ λ_n ⟂ w_n ≥ 0,     |λ_t| ≤ μ λ_n against w_t                (1)

v is the velocity at the end of the tick (3), A its effective mass, λ impulses, b what else the gap's rate has, and E a
diagonal of compliances: of the contact itself and of the body behind it. A guess of each contact's mode turns (1) into

    (A + Σ Gᵀ E⁻¹ G) v = r − Σ Gᵀ E⁻¹ b           over what is closed; a sliding λ_t = ± μ λ_n is carried along

three equations whose solution says which modes were wrong. All wrong ones change at once while their number falls, then
only the one that is most so (principal pivoting after Murty and Júdice & Pires). The guess is the last tick's answer,
so that mostly one solution is enough. Where the friction of (1) has several solutions any of them is taken; E > 0
excludes none that matters: at 1e-9 m/N a force of 20 N is 0.02 µm.

Their number is bounded, by the caller's `most` too. Pivoting with friction may go round in circles; after EXACT
solutions friction is bounded by the normal impulses of the last tick, |λ_t| ≤ f, instead. That problem is convex,
pivoting ends in practice always, and the answer is passive too: friction of any bound takes energy. Without an answer
even so the caller has v = 0.
"""

import math

from haptic_device.jit import njit

EXACT, BRAKED = 10, 30  # solutions at most
PATIENCE = 5  # solutions for which all wrong modes may change at once without their number falling
UNUSED, OPEN, STICK, UP, DOWN = -1.0, 0.0, 1.0, 2.0, 3.0  # UP, DOWN: sliding, friction at its upper, lower bound
N_X, N_Y, N_TURN, T_X, T_Y, T_TURN, B_N, B_T, E_N, E_T, MU, MODE, IMPULSE, SLIP_IMPULSE, BOUND, SENSE = range(16)
COLUMNS = 16  # BOUND: f of the last tick
ROUNDING = 1e-9


@njit
def solve(rows, mass, right, system, velocity, most):
    """Velocity (3) of (1), and the impulses in rows; returns the solutions it took, above EXACT if braked, or −1.

    rows: (contacts, COLUMNS); mass, right: (3) A and r; system: (3, 4) to work in; most: solutions that it may take.
    """
    turns = _pivot(rows, mass, right, system, velocity, bool(0), min(EXACT, most))  # a plain False: a kernel of its own
    if turns < 0 and most > EXACT:
        for one in rows:
            one[SENSE] = 1.0 if one[MODE] == UP else (-1.0 if one[MODE] == DOWN else 0.0)
        turns = _pivot(rows, mass, right, system, velocity, bool(1), min(BRAKED, most - EXACT))
        turns += EXACT if turns > 0 else 0
    for one in rows:
        one[BOUND] = one[MU] * one[IMPULSE]
    return turns


@njit
def _pivot(rows, mass, right, system, velocity, braked, most):
    fewest, patience = 4 * rows.shape[0], PATIENCE
    for turn in range(most):
        _assemble(rows, mass, right, system, braked)
        if not _eliminate(system, velocity):
            return -1
        wrong, worst = _review(rows, velocity, patience > 0, braked)
        if wrong == 0:
            return turn + 1
        # Bland's rule in effect: one at a time cannot circle without friction
        if patience <= 0:
            _change(rows[worst], velocity, braked)
        elif wrong < fewest:
            fewest, patience = wrong, PATIENCE
        else:
            patience -= 1
    return -1


@njit
def _assemble(rows, mass, right, system, braked):
    for i in range(3):
        for k in range(3):
            system[i, k] = 0.0
        system[i, i], system[i, 3] = mass[i], right[i]
    for one in rows:
        if one[MODE] == UNUSED:
            continue
        if one[MODE] != OPEN:
            sliding = 0.0 if braked else (one[MU] if one[MODE] == UP else (-one[MU] if one[MODE] == DOWN else 0.0))
            _close(one, system, sliding)
        if one[MU] > 0.0 and (one[SENSE] == 0.0 and one[BOUND] > 0.0 if braked else one[MODE] == STICK):
            _grip(one, system)
        elif braked:
            for i in range(3):
                system[i, 3] += one[T_X + i] * one[SENSE] * one[BOUND]


@njit
def _close(one, system, sliding):
    """λ_n = −(G_n v + b)/e, and λ_t = `sliding` times as much."""
    # E > 0: a compliant contact is a spring in the system
    stiff = 1.0 / one[E_N]
    for i in range(3):
        pushed = stiff * (one[N_X + i] + sliding * one[T_X + i])
        system[i, 3] -= pushed * one[B_N]
        for k in range(3):
            system[i, k] += pushed * one[N_X + k]


@njit
def _grip(one, system):
    """λ_t = −(G_t v + b)/e."""
    grip = 1.0 / one[E_T]
    for i in range(3):
        system[i, 3] -= grip * one[T_X + i] * one[B_T]
        for k in range(3):
            system[i, k] += grip * one[T_X + i] * one[T_X + k]


@njit
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


@njit
def _review(rows, velocity, change, braked):
    """Impulses of this solution; number and worst of the contacts whose modes it contradicts, which may change."""
    wrong, worst, most = 0, -1, 0.0
    for r in range(rows.shape[0]):
        one = rows[r]
        if one[MODE] == UNUSED:
            one[IMPULSE], one[SLIP_IMPULSE] = 0.0, 0.0
            continue
        mode, sense, size = _wished(one, velocity, braked)
        if mode != one[MODE] or sense != one[SENSE]:
            wrong += 1
            if size >= most:
                worst, most = r, size
            if change:
                one[MODE], one[SENSE] = mode, sense
    return wrong, worst


@njit
def _change(one, velocity, braked):
    """Takes the modes that the solution asks for."""
    mode, sense, size = _wished(one, velocity, braked)
    one[MODE], one[SENSE] = mode, sense


@njit
def _wished(one, velocity, braked):
    """Mode and sense that this solution asks for, and how wrong those there are [m/s]; notes its impulses."""
    rate, slip, size = one[B_N], one[B_T], abs(one[B_N]) + abs(one[B_T])
    for i in range(3):
        rate += one[N_X + i] * velocity[i]
        slip += one[T_X + i] * velocity[i]
        size += abs(one[N_X + i] * velocity[i]) + abs(one[T_X + i] * velocity[i])
    small = ROUNDING * size
    one[IMPULSE] = -rate / one[E_N] if one[MODE] != OPEN else 0.0
    one[SLIP_IMPULSE] = 0.0
    if braked:
        return _wished_braked(one, rate, slip, small)
    if one[MODE] == OPEN:
        return (STICK if rate < -small else OPEN), one[SENSE], -rate
    if one[IMPULSE] < 0.0:
        return OPEN, one[SENSE], rate
    if one[MU] == 0.0:
        return one[MODE], one[SENSE], 0.0
    # Coulomb's cone
    bound = one[MU] * one[IMPULSE]
    if one[MODE] == STICK:
        one[SLIP_IMPULSE] = -slip / one[E_T]
        if abs(one[SLIP_IMPULSE]) <= bound * (1.0 + ROUNDING):
            return STICK, one[SENSE], 0.0
        return (UP if one[SLIP_IMPULSE] > 0.0 else DOWN), one[SENSE], (abs(one[SLIP_IMPULSE]) - bound) * one[E_N]
    one[SLIP_IMPULSE] = bound if one[MODE] == UP else -bound
    against = slip if one[MODE] == UP else -slip
    return (STICK if against > small else one[MODE]), one[SENSE], against


@njit
def _wished_braked(one, rate, slip, small):
    """The same with friction of a fixed bound, whose sense is apart from whether the contact is closed."""
    closed, sense, wrong = one[MODE] != OPEN, one[SENSE], 0.0
    if closed and one[IMPULSE] < 0.0:
        closed, wrong = False, rate
    elif not closed and rate < -small:
        closed, wrong = True, -rate
    if one[BOUND] > 0.0:
        if sense == 0.0:
            one[SLIP_IMPULSE] = -slip / one[E_T]
            over = abs(one[SLIP_IMPULSE]) - one[BOUND] * (1.0 + ROUNDING)
            if over > 0.0:
                sense, wrong = math.copysign(1.0, one[SLIP_IMPULSE]), max(wrong, over * one[E_T])
        else:
            one[SLIP_IMPULSE] = sense * one[BOUND]
            if sense * slip > small:
                sense, wrong = 0.0, max(wrong, abs(slip))
    mode = OPEN if not closed else (UP if sense > 0.0 else (DOWN if sense < 0.0 else STICK))
    if one[MODE] != OPEN and closed:
        mode = mode if sense != one[SENSE] else one[MODE]
    return mode, sense, wrong
