# SPDX-License-Identifier: Apache-2.0
"""One cell of the K–B plane in lock-step: a handle that taps a wall and is pressed against it, one axis.

The laws are the servo's own (encoder, wall) and the plant's own (exact motion under the hold); what a whole servo tick
does besides is left out, because a map takes ten million ticks. x is the depth [m], positive in the wall.
"""

import math

import numpy as np

from haptic_device.control import velocity_estimator, virtual_wall
from haptic_device.device import plant
from haptic_device.jit import kernel, njit

CELL = np.dtype(
    [
        (name, "f8")
        for name in (
            *("mass", "physical_damping", "coulomb", "resolution", "period", "delay_samples", "velocity_lag"),
            *("operator_mass", "operator_damping", "operator_stiffness", "push"),  # on the handle; push [N] inwards
            *("position", "depth", "velocity", "seconds"),  # the start: [m], times the depth of rest, and for how long
        )
    ]
)
OUTCOME = np.dtype([(name, "f8") for name in ("beginning", "vibration", "growth", "energy_given", "contact_lost")])
DIVERGED = 1e6  # times the energy of the beginning: no need to look further
TINY = 1e-300  # N/m
FEWEST_TICKS = 8  # two in each quarter


@kernel
def cells(setup, stiffness, damping, outcomes):
    """Fills outcomes (n OUTCOME) for the walls of stiffness (n) [N/m] and damping (n) [N s/m]; setup: one CELL."""
    waiting = np.zeros(int(setup[0].delay_samples) + 1)
    for i in range(stiffness.size):
        cell(setup[0], stiffness[i], damping[i], waiting, outcomes[i])


@kernel
def cell(setup, stiffness, damping, waiting, outcome):
    """One wall. waiting: room for the force of this tick and for each on its way through the delay.

    beginning [J]: all mechanical energy of the start above that of rest against the wall, the wall's spring included.
    vibration [J]: the same above that of the nearest place where friction holds the handle, 0 while it stands still, as
    the mean over the last quarter; growth: its ratio to that of the quarter before. energy_given [J]: most that the
    operator ever had from the display, beyond what device and wall held at the start. contact_lost: share of the last
    quarter.
    """
    x, v = setup.position + setup.depth * _rest(setup, stiffness), setup.velocity
    own = 0.5 * (setup.mass * v * v + stiffness * max(0.0, x) ** 2)
    waiting[:] = -virtual_wall.wall_force(stiffness, damping, _read(setup, x), 0.0)
    seen, rate, held, given, most = _read(setup, x), 0.0, waiting[0], 0.0, 0.0
    late = setup.delay_samples % 1.0 * setup.period
    ticks = max(FEWEST_TICKS, int(round(setup.seconds / setup.period)))
    quarter, before, last, lost = ticks // 4, 0.0, 0.0, 0.0
    beginning = _motion(setup, stiffness, 0.0, x, v)
    for k in range(ticks):
        reading = _read(setup, x)
        rate = velocity_estimator.velocity_of(rate, reading - seen, setup.period if k > 0 else 0.0, setup.velocity_lag)
        waiting[k % waiting.size] = -virtual_wall.wall_force(stiffness, damping, reading, rate)
        seen, force = reading, waiting[(k + 1) % waiting.size]
        begun = x
        x, v, early = _hold(setup, held, x, v, late)
        x, v, gift = _hold(setup, force, x, v, setup.period - late)
        held, given = force, given + early + gift
        most = max(most, given)
        energy = 0.0 if v == 0.0 and x == begun else _motion(setup, stiffness, setup.coulomb, x, v)
        if k >= ticks - quarter:
            last, lost = last + energy, lost + (x < 0.0)
        elif k >= ticks - 2 * quarter:
            before += energy
        if not energy < DIVERGED * beginning:
            before, last = 1.0, math.inf
            break
    outcome.beginning, outcome.contact_lost = beginning, lost / quarter
    outcome.vibration, outcome.growth = last / quarter, last / before if before > 0.0 else 0.0
    outcome.energy_given = most - own


@njit
def _read(setup, x):
    """Position as the encoder shows it; resolution 0 is an encoder without steps."""
    if setup.resolution <= 0.0:
        return x
    return velocity_estimator.position_of(math.floor(x / setup.resolution + 0.5), setup.resolution, 0.0)


@njit
def _hold(setup, motor, x, v, time):
    """Position, velocity and energy given to the operator over one hold of the motor force [N].

    What the dampers took is what of the work is in no mass, spring or friction; they share it by their coefficients.
    """
    if time <= 0.0:
        return x, v, 0.0
    mass, loss = setup.mass + setup.operator_mass, setup.physical_damping + setup.operator_damping
    stiffness, force = setup.operator_stiffness, motor + setup.push
    x1, v1, slid = plant.slide(mass, loss, stiffness, setup.coulomb, force, 0.0, x, v, time)
    spring, kinetic = 0.5 * stiffness * (x1 * x1 - x * x), 0.5 * (v1 * v1 - v * v)
    taken = force * (x1 - x) - spring - mass * kinetic - setup.coulomb * slid
    given = spring - setup.push * (x1 - x) + setup.operator_mass * kinetic + setup.operator_damping / loss * taken
    return x1, v1, given


@njit
def _motion(setup, stiffness, friction, x, v):
    """Mechanical energy [J] of device, operator and the wall's spring above that of the nearest place where this much
    friction [N] holds the handle: where push and springs pull with no more. What it loses on its way there is no part.
    """
    kinetic, spring = 0.5 * (setup.mass + setup.operator_mass) * v * v, stiffness + setup.operator_stiffness
    if spring <= 0.0:
        return kinetic
    pull = setup.push - friction  # of what is left of the push at the wall's surface
    if x >= 0.0:
        return kinetic + 0.5 * max(0.0, abs(spring * x - setup.push) - friction) ** 2 / spring
    if pull >= 0.0:
        return kinetic + 0.5 * pull * pull / spring - pull * x + 0.5 * setup.operator_stiffness * x * x
    return kinetic + 0.5 * max(0.0, pull - setup.operator_stiffness * x) ** 2 / max(setup.operator_stiffness, TINY)


@njit
def _rest(setup, stiffness):
    """Depth [m] at which the operator's push rests against the wall; 0 where nothing would hold it."""
    spring = stiffness + setup.operator_stiffness
    return setup.push / spring if spring > 0.0 else 0.0
