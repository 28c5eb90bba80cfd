# SPDX-License-Identifier: Apache-2.0
"""The tool's port behind an exchange method: how much of the wanted pull a tank of energy, a limit and a slew allow.

Over a sub-step h the coupling's force on one axis of the tool is a − (h K + B) v⁺ with the pull at rest
a = K (x_h − x) + B v_h, and the energy it supplies, h (a − (h K + B) v⁺) v⁺, is at most W a² with W = h/4(h K + B),
whatever contacts make of v⁺. A tank E that holds that much is never overdrawn. Letting go of the pull at the slew,
by d = slew · h a sub-step, takes no more than W a³/3d on top (the sum of W (a − k d)²), so that

    W a² (1 + a/3d) ≤ E

is what a pull may be: then it can be let go slowly whatever comes. Limits: d → ∞ asks for the tank alone.
"""

import math

from haptic_device.control import set_position
from haptic_device.jit import kernel, njit

DAMPER_SLEW = 0.25  # share of the slew that the handle's velocity may make on top of it, where there is a spring too
STIFFNESS, DAMPING, WORST, LIMIT, STEP, RULES = 0, 3, 6, 8, 10, 12  # gains by axis; W, limit and d of x-y and of theta
TANK, AIM, SPEED, PAST, JOINED, PULL, SHARE, MEMORY = 0, 1, 4, 7, 10, 11, 13, 14


@kernel
def worst(stiffness, damping, sub_step):
    """W = h/4(h K + B) [J/N² | J/(N m)²]; 0 where nothing couples."""
    hold = sub_step * stiffness + damping
    return 0.25 * sub_step / hold if hold > 0.0 else 0.0


@kernel
def drive(rules, memory, handle, rate, tool):
    """Fills in AIM and SPEED of the memory: handle's place and velocity for a sub-step that starts with the tool there.

    As wanted, or drawn nearer to the tool: what the samples change of the pull is at most the slew (and a quarter of it
    by their velocity), the pull at most the limit, and its energy at most the tank's. rules, memory: as the indices
    above say; handle, rate, tool: of three axes.
    """
    for i in range(3):
        if memory[JOINED] == 0.0:
            memory[AIM + i], memory[SPEED + i], memory[PAST + i] = tool[i], 0.0, tool[i]
        step, stiffness, damping = rules[STEP + i // 2], rules[STIFFNESS + i], rules[DAMPING + i]
        reach = step / stiffness if stiffness > 0.0 else math.inf
        memory[AIM + i] = set_position.slewed(memory[AIM + i], handle[i], tool[i] - memory[PAST + i], reach)
        step *= DAMPER_SLEW if stiffness > 0.0 else 1.0
        reach = step / damping if damping > 0.0 else math.inf
        memory[SPEED + i] = set_position.slewed(memory[SPEED + i], rate[i], 0.0, reach)
        memory[PAST + i] = tool[i]
    memory[JOINED], memory[SHARE] = 1.0, 1.0
    line = math.hypot(_pull(rules, memory, tool, 0), _pull(rules, memory, tool, 1))
    turn = abs(_pull(rules, memory, tool, 2))
    nearer_line, nearer_turn = _allowed(rules, memory, line, turn)
    _draw(memory, tool, 0, nearer_line)
    _draw(memory, tool, 1, nearer_line)
    _draw(memory, tool, 2, nearer_turn)
    memory[PULL], memory[PULL + 1] = nearer_line * line, nearer_turn * turn


@njit
def _pull(rules, memory, tool, i):
    return rules[STIFFNESS + i] * (memory[AIM + i] - tool[i]) + rules[DAMPING + i] * memory[SPEED + i]


@njit
def _draw(memory, tool, i, share):
    memory[AIM + i] = tool[i] + share * (memory[AIM + i] - tool[i])
    memory[SPEED + i] *= share


@njit
def _allowed(rules, memory, line, turn):
    """Shares 0…1 of the pull in the plane and of the torque; SHARE says how much energy has left of either."""
    straight, around = min(line, rules[LIMIT]), min(turn, rules[LIMIT + 1])
    tank = max(0.0, memory[TANK])  # rounding may leave it below 0, where a pull of none would be too much
    kept = _kept(rules, 0, straight) + _kept(rules, 1, around)
    if kept > tank:
        share = math.sqrt(tank / kept)
        straight = min(straight, max(share * straight, memory[PULL] - rules[STEP]))
        around = min(around, max(share * around, memory[PULL + 1] - rules[STEP + 1]))
        memory[SHARE] = share
    most = rules[WORST] * straight * straight + rules[WORST + 1] * around * around
    if most > tank:  # the tool's own motion has made more of it
        share = math.sqrt(tank / most)
        straight, around, memory[SHARE] = share * straight, share * around, share
    return straight / line if line > 0.0 else 1.0, around / turn if turn > 0.0 else 1.0


@njit
def _kept(rules, i, pull):
    """Energy [J] of a pull over a sub-step and of letting go of it at the slew."""
    return rules[WORST + i] * pull * pull * (1.0 + pull / (3.0 * rules[STEP + i]))
