# SPDX-License-Identifier: Apache-2.0
"""The tool's port behind an exchange method: how much of the wanted pull a tank of energy, a limit and a slew allow.

Over a sub-step h the coupling's force on one axis of the tool is a − (h K + B) v⁺ with the pull at rest
a = K (x_h − x) + B v_h, and the energy it supplies, h (a − (h K + B) v⁺) v⁺, is at most W a² with W = h/4(h K + B),
whatever contacts make of v⁺. A tank E that holds that much is never overdrawn. Letting go of the pull at the slew,
by d = slew · h a sub-step, takes no more than W a³/3d on top (the sum of W (a − k d)²), so that

    W a² (1 + a/3d) ≤ E

is what a pull may be: then it can be let go slowly whatever comes. Limits: d → ∞ asks for the tank alone. For the
largest pull that the device holds, as the handle samples tell it, that is the reserve which a port begins with.

Over sub-steps in a row, N steps h of the world in all, the handle goes a way that is known beforehand. Let a_j be the
pull at rest of step j were the tool still where it began, d_j the move h v⁺ that its force is taken for, and θ_j d_j,
0 ≤ θ_j ≤ 1, as much of it as the world lets the tool make. What is supplied is then

    Σ [a_j − K Σ_{k<j} θ_k d_k − (K + B/h) d_j] d_j.

With Σ_{k<j} θ_k d_k d_j = ½ Σ_{k<j} (2 θ_k − 1) d_k d_j + ¼ [(Σ d_j)² − Σ d_j²], where |2 θ_k − 1| ≤ 1 and
Σ_{k<j} |d_k d_j| ≤ ½ (N − 1) Σ d_j², the sum is ≥ −¼ N Σ d_j². So no more than

    Σ (a_j d_j − λ d_j²) ≤ Σ a_j²/4λ ≤ N max a_j²/4λ,      λ = K (1 − N/4) + B/h,

is supplied whatever the tool does, if λ > 0: that is, if the steps together take less than about 4 B/K. Of a step that
takes from the tool only what is made counts; a whole move as long would take less. Not in it is the way by which
overlaps are taken back, some µm. Where the tank holds that much and what letting go takes, and no limit is near, the
whole way is made at once.
"""

import math

from haptic_device.control import set_position
from haptic_device.jit import kernel, njit

DAMPER_SLEW = 0.25  # share of the slew that the handle's velocity may make on top of it, where there is a spring too
AT_ONCE = 0.75  # share of a limit up to which a way is made at once: what the tool does meanwhile comes on top
STIFFNESS, DAMPING, WORST, LIMIT, STEP = 0, 3, 6, 8, 10  # gains by axis; W, limit and d of x-y and of theta
TIME, INNER = 12, 13  # step of the world [s], and how many are a sub-step
TOLD, RULES = 14, 17  # limit of the spring on the hand, by axis; 0 where it is not told
TANK, AIM, SPEED, PAST, JOINED, PULL, SHORT, MEMORY = 0, 1, 4, 7, 10, 11, 13, 14


@kernel
def worst(stiffness, damping, sub_step):
    """W = h/4(h K + B) [J/N² | J/(N m)²]; 0 where nothing couples."""
    hold = sub_step * stiffness + damping
    return 0.25 * sub_step / hold if hold > 0.0 else 0.0


@kernel
def drive(rules, memory, handle, rate, tool):
    """Fills in AIM and SPEED of the memory: handle's place and velocity for a sub-step that starts with the tool there.

    As wanted, or drawn nearer to the tool: what the samples change of the pull is at most the slew (and a quarter of it
    by their velocity), the pull at most what the hand feels and the limit, and its energy at most the tank's; SHORT: 1
    where limit or tank made less of it. rules, memory: as the indices above say; handle, rate, tool: of three axes.
    """
    for i in range(3):
        if memory[JOINED] == 0.0:
            memory[AIM + i], memory[SPEED + i], memory[PAST + i] = tool[i], 0.0, tool[i]
        step, stiffness, damping = rules[STEP + i // 2], rules[STIFFNESS + i], rules[DAMPING + i]
        reach = step / stiffness if stiffness > 0.0 else math.inf
        wanted = _as_felt(rules, handle[i], tool[i], i)
        memory[AIM + i] = set_position.slewed(memory[AIM + i], wanted, tool[i] - memory[PAST + i], reach)
        step *= DAMPER_SLEW if stiffness > 0.0 else 1.0
        reach = step / damping if damping > 0.0 else math.inf
        memory[SPEED + i] = set_position.slewed(memory[SPEED + i], rate[i], 0.0, reach)
        memory[PAST + i] = tool[i]
    memory[JOINED] = 1.0
    line = math.hypot(_pull(rules, memory, tool, 0), _pull(rules, memory, tool, 1))
    turn = abs(_pull(rules, memory, tool, 2))
    nearer_line, nearer_turn = _allowed(rules, memory, line, turn)
    _draw(memory, tool, 0, nearer_line)
    _draw(memory, tool, 1, nearer_line)
    _draw(memory, tool, 2, nearer_turn)
    memory[PULL], memory[PULL + 1] = nearer_line * line, nearer_turn * turn
    memory[SHORT] = 1.0 if min(nearer_line, nearer_turn) < 1.0 else 0.0


@kernel
def covers(rules, memory, way, tool, count):
    """Whether the handle may go its whole way of `count` sub-steps as it is, the tool being there: drive would let it.

    way: (2, 6) array, position and velocity before and after. Nothing of the memory is changed.
    """
    if memory[JOINED] == 0.0:
        return False
    for i in range(3):
        step, aim, speed = rules[STEP + i // 2], memory[AIM + i], memory[SPEED + i]
        if rules[STIFFNESS + i] * _fastest(way[0, i], way[1, i], aim, count) > step:
            return False
        step *= DAMPER_SLEW if rules[STIFFNESS + i] > 0.0 else 1.0
        if rules[DAMPING + i] * _fastest(way[0, 3 + i], way[1, 3 + i], speed, count) > step:
            return False
        if _as_felt(rules, way[0, i], tool[i], i) != way[0, i] or _as_felt(rules, way[1, i], tool[i], i) != way[1, i]:
            return False
    line = turn = 0.0  # a pull that changes evenly is largest at an end
    for row in range(2):
        x, y = _pull_on_way(rules, way, tool, row, 0), _pull_on_way(rules, way, tool, row, 1)
        line, turn = max(line, math.hypot(x, y)), max(turn, abs(_pull_on_way(rules, way, tool, row, 2)))
    return _needed(rules, 0, line, count) + _needed(rules, 1, turn, count) <= memory[TANK]


@njit
def _fastest(start, end, known, count):
    """Largest change in a sub-step of what is `known` now and then goes from start to end in `count` of them."""
    each = (end - start) / count
    return max(abs(each), abs(start + each - known))


@njit
def _pull_on_way(rules, way, tool, row, i):
    return rules[STIFFNESS + i] * (way[row, i] - tool[i]) + rules[DAMPING + i] * way[row, 3 + i]


@njit
def _needed(rules, group, pull, count):
    """Energy [J] that `count` sub-steps of at most this pull, and letting go of it, can take; inf where no bound is."""
    steps, stiffness, damping = count * rules[INNER], rules[STIFFNESS + 2 * group], rules[DAMPING + 2 * group]
    held = stiffness * (1.0 - 0.25 * steps) + damping / rules[TIME]
    if pull == 0.0 and stiffness == 0.0:
        return 0.0
    if held <= 0.0 or pull > AT_ONCE * rules[LIMIT + group]:
        return math.inf
    return steps * pull * pull / (4.0 * held) + kept(rules, group, pull)


@kernel
def went(rules, memory, way, tool):
    """The memory after the handle has gone its whole way as it is, and the tool has come there."""
    for i in range(3):
        memory[AIM + i], memory[SPEED + i], memory[PAST + i] = way[1, i], way[1, 3 + i], tool[i]
    memory[SHORT] = 0.0
    memory[PULL] = math.hypot(_pull(rules, memory, tool, 0), _pull(rules, memory, tool, 1))
    memory[PULL + 1] = abs(_pull(rules, memory, tool, 2))


@njit
def _pull(rules, memory, tool, i):
    return rules[STIFFNESS + i] * (memory[AIM + i] - tool[i]) + rules[DAMPING + i] * memory[SPEED + i]


@njit
def _draw(memory, tool, i, share):
    memory[AIM + i] = tool[i] + share * (memory[AIM + i] - tool[i])
    memory[SPEED + i] *= share


@njit
def _allowed(rules, memory, line, turn):
    """Shares 0…1 of the pull in the plane and of the torque that limits and energy leave."""
    straight, around = min(line, rules[LIMIT]), min(turn, rules[LIMIT + 1])
    tank = max(0.0, memory[TANK])  # rounding may leave it below 0, where a pull of none would be too much
    reserve = kept(rules, 0, straight) + kept(rules, 1, around)
    if reserve > tank:
        share = math.sqrt(tank / reserve)
        straight = min(straight, max(share * straight, memory[PULL] - rules[STEP]))
        around = min(around, max(share * around, memory[PULL + 1] - rules[STEP + 1]))
    most = rules[WORST] * straight * straight + rules[WORST + 1] * around * around
    if most > tank:  # the tool's own motion has made more of it
        share = math.sqrt(tank / most)
        straight, around = share * straight, share * around
    return straight / line if line > 0.0 else 1.0, around / turn if turn > 0.0 else 1.0


@njit
def _as_felt(rules, handle, tool, i):
    """Where the handle pulls from: no farther from the tool than the hand feels its spring, where that is told."""
    if not (rules[TOLD + i] > 0.0 and rules[STIFFNESS + i] > 0.0):
        return handle
    reach = rules[TOLD + i] / rules[STIFFNESS + i]
    return min(tool + reach, max(tool - reach, handle))


@kernel
def kept(rules, i, pull):
    """Energy [J] of a pull over a sub-step and of letting go of it at the slew."""
    return rules[WORST + i] * pull * pull * (1.0 + pull / (3.0 * rules[STEP + i]))
