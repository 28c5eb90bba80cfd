# SPDX-License-Identifier: Apache-2.0
"""A linkage as physics: joints θ that carry the handle p(θ), driven by their motors and by the hand at the handle.

With J = ∂p/∂θ, the mass m of handle and gripping hand, and the force g(p, p', t) of the hand's spring and damper:

    M θ'' = τ − b θ' − f sign(θ') + Jᵀ (g − m J' θ'),   M = diag(I) + Jᵀ m J                                         (1)

J' θ' is in closed form. Between events, where a joint reverses or comes loose, (1) is smooth, and Butcher's method of
order 6 in seven stages integrates it. Each joint sticks by itself, while the torque that holds it is at most f.
"""

import math

import numpy as np

from haptic_device.config import kinematics
from haptic_device.control import linkage
from haptic_device.jit import njit

FIVE_BAR, SERIAL_2R = float(kinematics.FIVE_BAR), float(kinematics.SERIAL_2R)
REACH = 0.5  # longest step, in times of the fastest rate
MOST = 1000  # steps in a sub-step
EVENTS = 8  # in a step
STOP = 0.01  # distance from singular at which the links meet a stop, all at once
A, B, A_VELOCITY, B_VELOCITY, GIVEN, TIME = range(6)  # state: [rad], [rad/s], [J] to the operator, [s]
STUCK = 0.0  # mode of a joint; else the sign of its sliding, 1 where nothing rubs
_STAGES = np.zeros((7, 7))  # what of each stage's slope leads to the next
_STAGES[0, 0], _STAGES[1, 1], _STAGES[2, :3] = 1 / 3, 2 / 3, (1 / 12, 1 / 3, -1 / 12)
_STAGES[3, :4] = -1 / 16, 9 / 8, -3 / 16, -3 / 8
_STAGES[4, :5] = 0.0, 9 / 8, -3 / 8, -3 / 4, 1 / 2
_STAGES[5, :6] = 9 / 44, -9 / 11, 63 / 44, 18 / 11, 0.0, -16 / 11
_STAGES[6, :7] = 11 / 120, 0.0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120


@njit
def begin(plant, memory):
    """Before anything has moved: joints where the handle is put."""
    if memory.knot == 0:
        memory.joint[0], memory.joint[1], _ = linkage.angles(plant.linkage, memory.position[0], memory.position[1])
        for i in range(2 if plant.axes > 1 else 0):  # a pulley's turns are counted
            turns = (plant.middle[i] - memory.joint[i]) / (2.0 * math.pi)
            memory.joint[i] += 2.0 * math.pi * math.floor(turns + 0.5)


@njit
def push(plant, memory):
    """Writes the force on the handle that the motors' torques make in this pose."""
    _, _, xa, xb, ya, yb, _ = linkage.pose(plant.linkage, memory.joint[0], memory.joint[1])
    force = linkage.to_handle(np.array([[xa, xb], [ya, yb]]), float(min(2, plant.axes)), memory.torque)
    memory.motor_force[0], memory.motor_force[1] = force


@njit
def step(plant, memory, time, target, grip):
    """Integrates over this time [s] while the hand's target moves uniformly to target; returns the energy given [J]."""
    state, before, mode, stages, trial = np.zeros(6), np.empty(6), np.empty(2), np.empty((7, 6)), np.empty(6)
    rate, axes = 0.0, min(2, plant.axes)
    for i in range(axes):
        state[i], state[2 + i] = memory.joint[i], memory.joint_velocity[i]
        memory.target_velocity[i] = (target[i] - memory.target[i]) / time
        mass = plant.handle_mass + grip * plant.hand_mass[i]
        fast = math.sqrt(grip * plant.hand_stiffness[i] / mass) + grip * plant.hand_damping[i] / mass
        rate = max(rate, fast + plant.damping[i] / plant.mass[i] + 8.0 * abs(state[2 + i]))
    count = 1 + int(min(rate * time / REACH, MOST))
    for _ in range(count):
        before[:] = state
        _advance(plant, memory, grip, state, time / count, mode, stages, trial)
        if not linkage.pose(plant.linkage, state[A], state[B])[6] >= STOP:
            state[:TIME] = before[:TIME]
            state[A_VELOCITY] = state[B_VELOCITY] = 0.0
    state[TIME] = 0.0
    for i in range(axes):
        memory.joint[i], memory.joint_velocity[i], memory.target[i] = state[i], state[2 + i], target[i]
    loads = _loads(plant, memory, grip, state)
    _choose(plant, loads, state, mode)
    operator = _felt(plant, grip, loads, mode)
    for i in range(axes):
        memory.position[i], memory.velocity[i], memory.operator_force[i] = loads[7 + i], loads[9 + i], operator[i]
    push(plant, memory)
    return state[GIVEN]


@njit
def _advance(plant, memory, grip, state, time, mode, stages, trial):
    """A step of the state, from event to event."""
    for _ in range(EVENTS):
        _choose(plant, _loads(plant, memory, grip, state), state, mode)
        if _try(plant, memory, grip, state, time, mode, stages, trial):
            break
        low, high = 0.0, time
        for _ in range(50):
            middle = 0.5 * (low + high)
            if _try(plant, memory, grip, state, middle, mode, stages, trial):
                low = middle
            else:
                high = middle
        _try(plant, memory, grip, state, high, mode, stages, trial)
        state[:] = trial
        for i in range(2):
            if plant.coulomb[i] > 0.0 and mode[i] * state[2 + i] <= 0.0:
                state[2 + i] = 0.0
        time -= high
    state[:] = trial


@njit
def _try(plant, memory, grip, state, time, mode, stages, trial):
    """Writes the state after this time into trial; whether each joint is still in its mode."""
    trial[:] = state
    for k in range(7):
        loads = _loads(plant, memory, grip, trial)
        x, y = _felt(plant, grip, loads, mode)
        stages[k, A], stages[k, B], stages[k, TIME] = trial[A_VELOCITY], trial[B_VELOCITY], 1.0
        stages[k, A_VELOCITY], stages[k, B_VELOCITY] = _accelerations(plant, loads, mode)
        stages[k, GIVEN] = -x * loads[9] - y * loads[10]
        trial[:] = state
        for m in range(k + 1):
            for n in range(6):
                trial[n] += time * _STAGES[k, m] * stages[m, n]
    return _agree(plant, _loads(plant, memory, grip, trial), trial, mode)


@njit
def _choose(plant, loads, state, mode):
    """Writes the modes of the joints: the only ones that friction and acceleration agree on."""
    for k in range(9):
        mode[0], mode[1] = 1.0 - k // 3, 1.0 - k % 3
        if _agree(plant, loads, state, mode):
            return
    for i in range(2):  # between two of them by rounding
        mode[i] = np.sign(state[2 + i]) if plant.coulomb[i] > 0.0 else 1.0


@njit
def _agree(plant, loads, state, mode):
    """Whether each joint moves, or is held, as its mode says."""
    agreed, grows = True, _accelerations(plant, loads, mode)
    for i in range(2):
        speed, most = state[2 + i], plant.coulomb[i]
        if most <= 0.0:
            agreed &= mode[i] == 1.0
        elif mode[i] == STUCK:
            agreed &= speed == 0.0 and abs(loads[3 + i] - loads[1] * grows[1 - i]) <= most
        else:
            agreed &= mode[i] * (grows[i] if speed == 0.0 else speed) > 0.0
    return agreed


@njit
def _accelerations(plant, loads, mode):
    """Of both joints in these modes [rad/s²]."""
    aa, ab, bb = loads[:3]
    one, two = loads[3] - plant.coulomb[0] * mode[0], loads[4] - plant.coulomb[1] * mode[1]
    if mode[0] == STUCK or mode[1] == STUCK:
        return mode[0] * mode[0] * one / aa, mode[1] * mode[1] * two / bb
    det = aa * bb - ab * ab
    return (bb * one - ab * two) / det, (aa * two - ab * one) / det


@njit
def _felt(plant, grip, loads, mode):
    """Force (x, y) [N] of the hand on the handle: spring and damper, less what its own mass takes."""
    a, b = _accelerations(plant, loads, mode)
    _, _, _, _, _, x, y, _, _, _, _, s, t, xa, xb, ya, yb = loads
    x -= grip * plant.hand_mass[0] * (s + xa * a + xb * b)
    return x, y - grip * plant.hand_mass[1] * (t + ya * a + yb * b)


@njit
def _loads(plant, memory, grip, state):
    """(M₀₀, M₀₁, M₁₁) of (1), the torque on each joint of all but Coulomb friction, (x, y) of g, and of the handle."""
    handle = _handle(plant, state)
    x, y, u, v, s, t, xa, xb, ya, yb = handle
    m, n = plant.handle_mass + grip * plant.hand_mass[0], plant.handle_mass + grip * plant.hand_mass[1]
    f, g = _pull(plant, memory, grip, state, 0, x, u), _pull(plant, memory, grip, state, 1, y, v)
    one = memory.torque[0] - plant.damping[0] * state[A_VELOCITY] + xa * (f - m * s) + ya * (g - n * t)
    two = memory.torque[1] - plant.damping[1] * state[B_VELOCITY] + xb * (f - m * s) + yb * (g - n * t)
    aa, bb = plant.mass[0] + m * xa * xa + n * ya * ya, plant.mass[1] + m * xb * xb + n * yb * yb
    return (aa, m * xa * xb + n * ya * yb, bb, one, two, f, g) + handle


@njit
def _pull(plant, memory, grip, state, i, place, speed):
    stretch = memory.target[i] + memory.target_velocity[i] * state[TIME] - place
    return grip * (plant.hand_stiffness[i] * stretch + plant.hand_damping[i] * (memory.target_velocity[i] - speed))


@njit
def _handle(plant, state):
    """Place, speed and J' θ' of the handle, x and y each, and (∂x/∂a, ∂x/∂b, ∂y/∂a, ∂y/∂b).

    Of five bars: a distal link from elbow A to P keeps its length, so (P − A)·(P'' − A'') = −|P' − A'|², as the other.
    """
    link, a, b, p, q = plant.linkage, state[A], state[B], state[A_VELOCITY], state[B_VELOCITY]
    x, y, xa, xb, ya, yb, _ = linkage.pose(link, a, b)
    u, v, s, t = xa * p + xb * q, ya * p + yb * q, 0.0, 0.0
    if link.kind == FIVE_BAR:
        ax, ay = link.proximal * math.cos(a), link.proximal * math.sin(a)
        bx, by = link.proximal * math.cos(b), link.proximal * math.sin(b)
        ex, ey = x + link.origin_x - ax, y + link.origin_y - ay
        fx, fy = x + link.origin_x - link.base - bx, y + link.origin_y - by
        e = -(ex * ax + ey * ay) * p * p - (u + ay * p) ** 2 - (v - ax * p) ** 2
        f = -(fx * bx + fy * by) * q * q - (u + by * q) ** 2 - (v - bx * q) ** 2
        cross = ex * fy - ey * fx
        s, t = (e * fy - f * ey) / cross, (ex * f - fx * e) / cross
    elif link.kind == SERIAL_2R:
        first, second = link.proximal * p * p, link.distal * (p + q) * (p + q)
        s, t = -first * math.cos(a) - second * math.cos(a + b), -first * math.sin(a) - second * math.sin(a + b)
    return x, y, u, v, s, t, xa, xb, ya, yb
