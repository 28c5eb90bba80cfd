# SPDX-License-Identifier: Apache-2.0
"""Damping cancellation: negative virtual damping in free space against the device's own (Colgate 1995, section 3)."""

import math

from haptic_device.control import faults
from haptic_device.jit import kernel, njit

MODEL, MEASURED = range(2)
GUARD = 2.0  # measured drag beyond this many times the described damping is not believed


@kernel
def cancellation_fade(clearance, band, stretch, stretch_limit):
    """Factor 0…1: full in free space, none at a wall or with the coupling stretched.

    clearance: distance to the nearest wall [m] (inf without walls); stretch: of the coupling [m]. Cancelling inside a
    wall as well would need b(1 − ratio) > KT/2 there.
    """
    before_wall = min(1.0, max(0.0, clearance / band))
    unstretched = min(1.0, max(0.0, 1.0 - stretch / stretch_limit))
    return before_wall * unstretched


@kernel
def share_beside_coupling(held, exchange_fade):
    """Share left beside a coupling that would leave `held` of it and is faded: no jump as a tool comes or goes.

    Passive: the coupling needs exchange_fade (KT/2 + |B|), and both that need and what is left of b are linear in the
    fade, so what holds at 0 and at 1 holds between.
    """
    # linear in the fade: 1 without a coupling, `held` with a whole one
    return 1.0 - exchange_fade * (1.0 - held)


@kernel
def filter_drag(settings, compensation, i, drag, elapsed):
    """The measured drag of axis i behind its filter; returns a fault code: it must never swallow what is no number."""
    if not abs(drag) < math.inf:
        return faults.NOT_A_NUMBER
    compensation.drag[i] = filtered_drag(compensation.drag[i], drag, elapsed, settings.cancellation.filter)
    return faults.NONE


@kernel
def filtered_drag(previous, drag, elapsed, lag):
    """Next value of the measured drag [N | N m] behind a first-order lag [s], backward Euler."""
    return (lag * previous + elapsed * drag) / (lag + elapsed) if elapsed > 0.0 else previous


@kernel
def measured_cancellation_force(ratio, drag, damping, velocity):
    """The same from the drag that a sensor feels at the damper, guarded against over-cancelling.

    It pushes along the motion only, and by no more than GUARD times the described damping would drag: a bias at rest,
    or noise against the motion, becomes no force.
    """
    # drag along the motion: what it takes is positive, a bias against it is not
    along = drag * math.copysign(1.0, velocity)
    most = GUARD * damping * abs(velocity)
    return ratio * math.copysign(min(most, max(0.0, along)), velocity)


@kernel
def compensate(settings, compensation, motion, walls, output):
    """Negative damping of the device's own, in free space only: fills in cancellation_fade, and the measured force."""
    chosen, device = settings.cancellation, settings.hardware
    # a band before the nearest wall: within it cancellation fades, so that it is gone at the surface
    clearance = math.inf
    for i in range(int(settings.wall.count)):
        clearance = min(clearance, -walls.depth[i])
    fade = cancellation_fade(clearance, chosen.band, 0.0, 1.0)
    fade *= _left_by_coupling(settings, output)
    output.cancellation_fade = fade
    for i in range(int(settings.axes) if chosen.source == MEASURED else 0):
        damping, velocity = device.damping[i], motion.device_velocity[i]
        force = measured_cancellation_force(chosen.ratio * fade, compensation.drag[i], damping, velocity)
        # from the device to the world: power is the same at both
        output.force_cancellation[i] = force / device.scale[i]


@njit
def _left_by_coupling(settings, output):
    """Share of the cancellation that the coupling leaves: all without a tool, which then need not be anywhere."""
    if output.exchange_fade == 0.0:
        return 1.0
    chosen, pulled, handle = settings.cancellation, output.coupling_position, output.position
    stretch = math.hypot(pulled[0] - handle[0], pulled[1] - handle[1])
    twist = abs(pulled[2] - handle[2]) if settings.axes > 2.0 else 0.0
    held = cancellation_fade(math.inf, 1.0, stretch, chosen.stretch)
    held *= cancellation_fade(math.inf, 1.0, twist, chosen.twist)
    return share_beside_coupling(held, output.exchange_fade)
