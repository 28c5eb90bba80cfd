# SPDX-License-Identifier: Apache-2.0
"""The device as physics: each axis a mass with damper and Coulomb friction, driven by motor and hand.

Per axis, with the hand gripping (mass m_h, damper b_h, spring k_h to its target s(t), which moves uniformly within a
sub-step):

    (m + m_h) x'' + (b + b_h) x' + k_h x = u + g + k_h s + b_h s' − f_c sign(x')

Under a held motor force u this is linear between reversals of the motion. Its solution is summed as the Taylor series
of the matrix exponential to rounding error, over sub-steps of at most SUB_STEP; a reversal is found as an event, where
the axis sticks until the force exceeds f_c. No Euler step: the effect of sampling, which is under study, would drown.

The joints of a linkage are drives in place of x and y; linkage_plant moves them, and the handle with them.
"""

import math

import numpy as np

from haptic_device.control.linkage import CARTESIAN, LINKAGE
from haptic_device.device import linkage_plant
from haptic_device.jit import kernel, njit

QUEUED = 512  # motor values on their way through the actuation delay
KNOTS = 8192  # past states kept for delayed sensing: 0.4 s

_WHOLE = "time", "noise", "queue_head", "queue_tail", "knot"  # time: [ns] up to which the plant is integrated
PLANT = np.dtype(
    [
        *((name, "i8") for name in ("axes", "sensing_delay", "actuation_delay")),  # delays [ns]
        ("linkage", LINKAGE),
        *((name, "f8") for name in ("drag_bandwidth", "drag_bias", "drag_noise")),  # [rad/s], 0: unlimited; deviation
        *((name, "f8", (3,)) for name in ("gravity", "hand_mass", "hand_damping", "hand_stiffness")),  # gravity [N]
        # per drive: an axis, or a joint of a linkage [rad, N m]
        *((name, "f8", (3,)) for name in ("mass", "damping", "coulomb", "force_per_motor", "force_limit")),
        *((name, "f8", (3,)) for name in ("position_per_count", "zero")),
        *(("handle_mass", "f8"), ("middle", "f8", (2,))),  # of a linkage; between the limits of each joint [rad]
    ]
)
PLANT_MEMORY = np.dtype(
    [
        *((name, "i8") for name in _WHOLE),  # noise: state of the generator
        *((name, "f8") for name in ("grip", "energy_given")),  # [J] to the operator: −∫ operator_force · velocity dt
        *((name, "f8", (3,)) for name in ("position", "velocity", "motor_force", "target", "target_velocity", "drag")),
        ("operator_force", "f8", (3,)),  # of the hand on the handle
        *((name, "f8", (2,)) for name in ("joint", "joint_velocity", "torque")),  # of a linkage; of its motors [N m]
        *(("queue_time", "i8", (QUEUED,)), ("queue_force", "f8", (QUEUED, 3)), ("knot_time", "i8", (KNOTS,))),
        *((name, "f8", (KNOTS, 3)) for name in ("knot_position", "knot_velocity")),  # of each drive
    ]
)


@kernel
def drift(mass, damping, stiffness, force, force_rate, position, velocity, time):
    """Position and velocity after time [s] of mass·x'' + damping·x' + stiffness·x = force + force_rate·t, exactly.

    Taylor series: x⁽ⁿ⁺²⁾ = (F⁽ⁿ⁾ − D x⁽ⁿ⁺¹⁾ − k x⁽ⁿ⁾)/M, summed until two terms in a row change nothing (one alone may
    vanish while the next does not); meant for D t/M, k t²/M below 1.
    """
    lower, upper = velocity, (force - damping * velocity - stiffness * position) / mass
    drive = force_rate / mass
    weight = time
    x, v = position + velocity * time, velocity
    for n in range(1, 40):
        v += upper * weight
        weight *= time / (n + 1)
        x += upper * weight
        lower, upper, drive = upper, drive - (damping * upper + stiffness * lower) / mass, 0.0
        if max(abs(lower) * (n + 1), abs(upper) * time) * weight <= 1e-18 * min(abs(v) * time, abs(x)):
            break
    return x, v


@njit
def _reversal(mass, damping, stiffness, force, force_rate, position, velocity, time):
    """Time within (0, time) at which the velocity, which changes sign over it, is zero; by bisection."""
    low, high = 0.0, time
    for _ in range(60):
        middle = 0.5 * (low + high)
        _, v = drift(mass, damping, stiffness, force, force_rate, position, velocity, middle)
        if v * velocity > 0.0:
            low = middle
        else:
            high = middle
    return high


@kernel
def slide(mass, damping, stiffness, coulomb, force, force_rate, position, velocity, time):
    """Position and velocity after time [s] with Coulomb friction, and the path length slid; at most one reversal."""
    if coulomb <= 0.0:
        x, v = drift(mass, damping, stiffness, force, force_rate, position, velocity, time)
        return x, v, abs(x - position)
    slid, left = 0.0, time
    x, v = position, velocity
    for _ in range(3):
        drive = force - stiffness * x
        if v == 0.0 and abs(drive) <= coulomb:
            return x, 0.0, slid
        friction = math.copysign(coulomb, v if v != 0.0 else drive)
        x1, v1 = drift(mass, damping, stiffness, force - friction, force_rate, x, v, left)
        if v == 0.0 or v1 * v > 0.0:
            return x1, v1, slid + abs(x1 - x)
        until = _reversal(mass, damping, stiffness, force - friction, force_rate, x, v, left)
        x1, _ = drift(mass, damping, stiffness, force - friction, force_rate, x, v, until)
        slid, force, left = slid + abs(x1 - x), force + force_rate * until, left - until
        x, v = x1, 0.0
    return x, 0.0, slid


@njit
def push_motor(plant, memory, written, motor):
    """Queues motor values [motor units] written at this time [ns]; they act after the actuation delay."""
    slot = memory.queue_head % QUEUED
    memory.queue_time[slot] = written + plant.actuation_delay
    for i in range(3):
        force = motor[i] * plant.force_per_motor[i]
        memory.queue_force[slot, i] = min(plant.force_limit[i], max(-plant.force_limit[i], force))
    memory.queue_head += 1


@kernel
def next_change(memory, until):
    """Time [ns] at which the next queued motor value acts, or until."""
    if memory.queue_tail < memory.queue_head:
        return min(until, max(memory.time, memory.queue_time[memory.queue_tail % QUEUED]))
    return until


@kernel
def take_motor(plant, memory):
    """Applies every queued motor value whose time has come."""
    while memory.queue_tail < memory.queue_head and memory.queue_time[memory.queue_tail % QUEUED] <= memory.time:
        for i in range(3):
            memory.motor_force[i] = memory.queue_force[memory.queue_tail % QUEUED, i]
        if plant.linkage.kind != CARTESIAN:
            memory.torque[:] = memory.motor_force[:2]
            linkage_plant.begin(plant, memory)
            linkage_plant.push(plant, memory)
        memory.queue_tail += 1


@kernel
def sub_step(plant, memory, end, target, grip):
    """Integrates to end [ns], at most SUB_STEP ahead, while the hand's target moves uniformly to target (3)."""
    time = (end - memory.time) * 1e-9
    given, first = 0.0, 0
    if plant.linkage.kind != CARTESIAN:
        linkage_plant.begin(plant, memory)
        given, first = linkage_plant.step(plant, memory, time, target, grip), 2
    for i in range(first, plant.axes):
        mass = plant.mass[i] + grip * plant.hand_mass[i]
        damping = plant.damping[i] + grip * plant.hand_damping[i]
        stiffness = grip * plant.hand_stiffness[i]
        target_velocity = (target[i] - memory.target[i]) / time
        applied = memory.motor_force[i] + plant.gravity[i]
        force = applied + stiffness * memory.target[i] + grip * plant.hand_damping[i] * target_velocity
        x0, v0 = memory.position[i], memory.velocity[i]
        x, v, slid = slide(mass, damping, stiffness, plant.coulomb[i], force, stiffness * target_velocity, x0, v0, time)
        given += applied * (x - x0) - plant.coulomb[i] * slid - plant.damping[i] * _squared(x0, x, v0, v, time)
        given -= 0.5 * plant.mass[i] * (v * v - v0 * v0)
        memory.position[i], memory.velocity[i] = x, v
        memory.target[i], memory.target_velocity[i] = target[i], target_velocity
        memory.operator_force[i] = _grip_force(plant, memory, i, grip)
        _filter_drag(plant, memory, i, v, time)
    memory.energy_given += given
    memory.grip = grip
    memory.time = end
    _keep_knot(plant, memory)


@njit
def _squared(x0, x1, v0, v1, time):
    """∫ v² dt over the sub-step by Simpson, with the middle velocity of the cubic through both ends."""
    middle = 1.5 * (x1 - x0) / time - 0.25 * (v0 + v1)
    return time * (v0 * v0 + 4.0 * middle * middle + v1 * v1) / 6.0


@njit
def _grip_force(plant, memory, i, grip):
    """Force of the hand on the handle [N | N m]: spring and damper to its target, less what its own mass takes."""
    stretch = memory.target[i] - memory.position[i]
    rate = memory.target_velocity[i] - memory.velocity[i]
    spring = grip * (plant.hand_stiffness[i] * stretch + plant.hand_damping[i] * rate)
    others = memory.motor_force[i] + plant.gravity[i] - plant.damping[i] * memory.velocity[i]
    if memory.velocity[i] != 0.0:
        others -= math.copysign(plant.coulomb[i], memory.velocity[i])
    elif abs(others + spring) <= plant.coulomb[i]:
        return spring
    acceleration = (others + spring) / (plant.mass[i] + grip * plant.hand_mass[i])
    return spring - grip * plant.hand_mass[i] * acceleration


@njit
def _filter_drag(plant, memory, i, velocity, time):
    """The sensor's reading of the damper's drag, first-order behind its bandwidth."""
    share = 1.0 if plant.drag_bandwidth <= 0.0 else -math.expm1(-plant.drag_bandwidth * time)
    memory.drag[i] += share * (plant.damping[i] * velocity - memory.drag[i])


@njit
def _keep_knot(plant, memory):
    """Remembers this state for delayed sensing."""
    memory.knot += 1
    slot = memory.knot % KNOTS
    memory.knot_time[slot] = memory.time
    for i in range(plant.axes):
        memory.knot_position[slot, i], memory.knot_velocity[slot, i] = memory.position[i], memory.velocity[i]
    if plant.linkage.kind != CARTESIAN:
        memory.knot_position[slot, :2], memory.knot_velocity[slot, :2] = memory.joint, memory.joint_velocity


@kernel
def position_at(plant, memory, time, i):
    """Position of drive i at a past time [ns]: the cubic through the kept states around it; before them, the first."""
    if memory.knot == 0 and i < 2 and plant.linkage.kind != CARTESIAN:
        linkage_plant.begin(plant, memory)
        return memory.joint[i]
    if memory.knot == 0:
        return memory.position[i]
    later = memory.knot
    while later > max(1, memory.knot - KNOTS + 2) and memory.knot_time[(later - 1) % KNOTS] >= time:
        later -= 1
    one, two = (later - 1) % KNOTS, later % KNOTS
    span = (memory.knot_time[two] - memory.knot_time[one]) * 1e-9
    if later <= 1 or span <= 0.0 or time >= memory.knot_time[two]:
        return memory.knot_position[two, i]
    s = (time - memory.knot_time[one]) * 1e-9 / span
    x0, x1 = memory.knot_position[one, i], memory.knot_position[two, i]
    v0, v1 = memory.knot_velocity[one, i] * span, memory.knot_velocity[two, i] * span
    return x0 + s * (v0 + s * (3.0 * (x1 - x0) - 2.0 * v0 - v1 + s * (v0 + v1 - 2.0 * (x1 - x0))))


@kernel
def sense(plant, memory, latched, counts, drag):
    """Encoder counts latched at this time [ns] less the sensing delay, and the drag sensor's reading, into (3) each."""
    for i in range(plant.axes):
        position = position_at(plant, memory, latched - plant.sensing_delay, i)
        counts[i] = math.floor((position + plant.zero[i]) / plant.position_per_count[i] + 0.5)
        drag[i] = memory.drag[i] + plant.drag_bias + plant.drag_noise * _gauss(memory)


@njit
def _gauss(memory):
    """Sum of twelve uniform numbers less six: near normal, one generator state, the same bits every time."""
    total = -6.0
    for _ in range(12):
        memory.noise = (memory.noise * 1103515245 + 12345) & 0x7FFFFFFF
        total += memory.noise / 2147483648.0
    return total
