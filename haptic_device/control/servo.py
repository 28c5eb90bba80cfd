# SPDX-License-Identifier: Apache-2.0
"""One servo tick: the only place where laws meet. Row in, row out; memory is what lasts from tick to tick.

A row of TICK is both the tick's input (first columns, filled in by whoever runs the loop) and its output, so that a
trace of rows holds everything that is needed to compute the same ticks again.
"""

import math

import numpy as np

from haptic_device.control import (
    contact_model,
    contact_solver,
    damping_compensation,
    enable_state,
    exchange_controller,
    exchange_samples,
    faults,
    kinematics,
    passivity_observer,
    velocity_estimator,
    virtual_coupling,
    virtual_tool,
    virtual_wall,
)
from haptic_device.jit import kernel, njit
from haptic_device.parameters import MOST_WALLS

AXES = 3  # x, y, theta; a device with fewer leaves the rest at zero


def _columns(*names):
    """Structured type of float64 columns; `name*` is one per axis, `name#` one per wall, `name^` a history."""
    widths = {"*": AXES, "#": MOST_WALLS, "^": velocity_estimator.KEPT}
    return np.dtype([(n.rstrip("*#^"), "f8", (widths[n[-1]],)) if n[-1] in widths else (n, "f8") for n in names])


INPUTS = (
    *(
        "tick",
        "deadline",
        "lateness",
        "compute",
        "write_delay",
        "missed",
    ),  # ns of CLOCK_MONOTONIC; s; s and s of the tick before; count
    *("parameter_version", "command", "latched", "counts*", "drag*", "device_status"),  # latched: ns, of the counts
    *("tool_session", "tool_sequence", "tool_answered", "tool_age", "tool_position*", "tool_velocity*", "tool_effort*"),
    *("tool_contact", "tool_energy", "contact_set", "contact_age", "handle_sequence"),
)
OUTPUTS = (
    *("position*", "velocity*", "coupling_position*", "coupling_velocity*"),  # handle and what the coupling pulls to
    *("force_walls*", "force_coupling*", "force_cancellation*", "force_passivity*", "force_gravity*"),
    *("force_on_handle*", "motor*"),  # total as the motor holds it, at the device; and in motor units
    *("engage", "exchange_fade", "cancellation_fade", "exchange_energy", "energy_given*"),
    *("exchange_effort*", "exchange_tank", "exchange_shortened", "exchange_let_go"),  # next handle sample's; [J]; ticks
    *("local", "local_fallbacks", "local_stays", "local_pivots", "tools_apart"),  # acting; counts; of this tick; [m]
    *("generated*", "injected*", "injections"),  # observer [J], controller [N s/m], ticks it acted
    *("margin*", "surplus*"),  # of the physical damping [N s/m]
    *("state", "fault", "warmth*"),
)
TICK = _columns(*INPUTS, *OUTPUTS)

SETTINGS = _columns(
    *("version", "period", "axes"),
    *("position_per_count*", "zero*", "scale*", "motor_per_force*", "device_limit*", "gravity*", "physical_damping*"),
    *("position_low*", "position_high*", "velocity_limit*", "force_limit*"),
    *("stiffness*", "damping*", "coupling_limit*"),  # of the coupling; largest force of its spring
    *("walls", "wall_x#", "wall_y#", "wall_offset#", "wall_stiffness#", "wall_damping#"),
    *(
        "cancellation_ratio",
        "cancellation_band",
        "cancellation_stretch",
        "cancellation_twist",
        "cancellation_source",
        "cancellation_filter",
    ),
    *("velocity_estimator", "velocity_lag", "velocity_window"),
    *("passivity_control", "passivity_budget", "margin*", "cross"),
    *("exchange_method", "exchange_budget", "exchange_tank", "exchange_horizon", "exchange_play", "exchange_slew*"),
    *("exchange_agility*", "surplus*", "exchange_hold", "exchange_fade"),
    *("local_compliance", "local_apart", "local_hold", "local_rejoin"),
    *("engage_time", "engage_force", "engage_torque", "silence", "saturation"),
    *("duty", "duty_kept", "unattended"),
)

_MEMORY = _columns(
    *("started", "latched", "unseen", "device_position*", "device_velocity*", "offset*"),
    *("history", "times^", "positions_x^", "positions_y^", "positions_theta^"),
    *("deadline", "held_force*", "held_now*", "held_change*", "held_square*", "energy_given*"),  # of the hold
    *("exchange_fade", "engage", "state", "fault", "resets", "saturated", "warmth*"),
    *(
        "drag*",
        "moved*",
        "world*",
        "pulled*",
        "coupled",
        "limited*",
        "cancelled*",
        "credit",
        "growth*",
        "damper*",
        "store*",
        "generated*",
        "injections",
        "late",
        "walls_off",
        "walls_touched",
        "walls_held*",
    ),
    *("factor", "factor_held", "spring*", "clamp*", "push*", "damped*", "mixed*", "let_go"),  # of the coupling
    *("filled", "version", "tank", "owed", "shipped", "returned", "tool_session", "tool_energy", "shortened"),
    *("set*", "set_velocity*", "own_velocity*", "goal*", "stretch*", "stretched*"),
    *("midpoint*", "window_from*", "window_start", "window_holds", "counted*", "latched_before", "hold_before"),
    *("tool_answered", "oldest", "rate*", "wave*", "wave_store", "pending*", "come*", "sent*"),
    *(
        "near_number",
        "near_sent",
        "near_trust",
        "near_mass",
        "near_inertia",
        "near_extent",
        "near_gravity*",
    ),  # control/virtual_tool
    *("near_pose*", "near_fresh", "near_turn", "acting", "well", "fallbacks", "stays", "unsolved"),
    *("pivots", "copy*", "copy_velocity*", "mass*", "right*", "trial*"),
)
_TABLES = {
    "near": (contact_model.MOST, len(contact_model.EACH)),
    "places": (contact_model.MOST, contact_model.PLACE),
    "rows": (contact_model.MOST, contact_solver.COLUMNS),
    "shown": (contact_model.MOST,),
    "system": (3, 4),
    "pushed": (contact_model.MOST,),
    "shifted": (contact_model.MOST,),
    "pushes": (contact_model.MOST, virtual_tool.KEPT),
    "shifts": (contact_model.MOST, virtual_tool.KEPT),
}
MEMORY = np.dtype(_MEMORY.descr + [(name, "f8", shape) for name, shape in _TABLES.items()])


@kernel
def tick(settings, memory, row):
    """One tick of the servo: records of SETTINGS, MEMORY, TICK; reads the inputs in row and writes its outputs."""
    _clear(settings, row)
    _sense(settings, memory, row)
    exchange_controller.follow(settings, memory, row)
    passivity_observer.let_go_walls(settings, memory, row)
    _walls(settings, memory, row)
    _coupling(settings, row)
    _cancellation(settings, memory, row)
    passivity_observer.inject(settings, memory, row)
    _faults(settings, memory, row)
    _engage(settings, memory, row)
    _command_motor(settings, memory, row)
    passivity_observer.remember(settings, memory, row)
    exchange_controller.settle(settings, memory, row)


@njit
def _clear(settings, row):
    """Outputs that not every tick writes: rows are used again, and nothing of an old tick may stay in them."""
    row.exchange_energy = row.exchange_tank = row.exchange_shortened = 0.0
    row.local = row.local_fallbacks = row.local_stays = row.local_pivots = row.tools_apart = 0.0
    for i in range(int(settings.axes), AXES):
        row.position[i] = row.velocity[i] = row.force_cancellation[i] = row.exchange_effort[i] = row.warmth[i] = 0.0


@njit
def _sense(settings, memory, row):
    """Counts to handle position and velocity; books the energy of the hold that ends here.

    Counts that change without a newer time move nothing: their way is booked when such a time has come.
    """
    elapsed = (row.latched - memory.latched) * 1e-9 if memory.started else 0.0
    _keep_time(memory, row, elapsed)
    for i in range(int(settings.axes)):
        seen = velocity_estimator.position_of(row.counts[i], settings.position_per_count[i], settings.zero[i])
        before = memory.device_position[i] if memory.started else seen
        position = before if memory.unseen > 0.0 else seen
        moved = position - before
        memory.moved[i] = moved
        velocity = _velocity(settings, memory, i, position, moved, elapsed)
        _check_motion(settings, memory, i, position, velocity, moved, elapsed)
        _to_world(settings, memory, row, i, before, position, velocity)
        memory.device_position[i], memory.device_velocity[i] = position, velocity
        _filter_drag(settings, memory, row, i, elapsed)
    passivity_observer.book(settings, memory, row, elapsed)
    for i in range(AXES):
        row.energy_given[i], row.generated[i] = memory.energy_given[i], memory.generated[i]
        row.margin[i], row.surplus[i], memory.world[i] = settings.margin[i], settings.surplus[i], row.position[i]
    memory.latched = max(memory.latched, row.latched) if memory.started else row.latched
    memory.started = 1.0


@njit
def _keep_time(memory, row, elapsed):
    """A new sample's place in the history."""
    fresh = elapsed > 0.0 or not memory.started
    memory.unseen = 0.0 if fresh else memory.unseen + 1.0
    if fresh:
        memory.history += 1.0
        memory.times[int(memory.history) % velocity_estimator.KEPT] = row.latched * 1e-9


@njit
def _velocity(settings, memory, i, position, moved, elapsed):
    """Device velocity of axis i by the estimator that is set."""
    history = memory.positions_x if i == 0 else (memory.positions_y if i == 1 else memory.positions_theta)
    newest = int(memory.history) % velocity_estimator.KEPT
    history[newest] = position
    if settings.velocity_estimator == velocity_estimator.ADAPTIVE_WINDOW:
        count, longest = int(min(memory.history, velocity_estimator.KEPT)), int(settings.velocity_window)
        step = 1.01 * abs(settings.position_per_count[i])  # an end-fit line passes through quantized ends
        return velocity_estimator.adaptive_velocity(memory.times, history, newest, count, longest, step)
    lag = settings.velocity_lag if settings.velocity_estimator == velocity_estimator.LOWPASS else 0.0
    return velocity_estimator.velocity_of(memory.device_velocity[i], moved, elapsed, lag)


@njit
def _check_motion(settings, memory, i, position, velocity, moved, elapsed):
    low, high, limit = settings.position_low[i], settings.position_high[i], settings.velocity_limit[i]
    code = faults.motion_fault(position, velocity, low, high, limit, moved, elapsed)
    if code != faults.NONE and memory.fault == faults.NONE:
        memory.fault = code


@njit
def _filter_drag(settings, memory, row, i, elapsed):
    """The measured drag behind its filter, which must never swallow what is not a number."""
    if abs(row.drag[i]) < math.inf:
        memory.drag[i] = damping_compensation.filtered_drag(
            memory.drag[i], row.drag[i], elapsed, settings.cancellation_filter
        )
    elif memory.fault == faults.NONE:
        memory.fault = faults.NOT_A_NUMBER


@njit
def _to_world(settings, memory, row, i, before, position, velocity):
    """Handle in the world; under an open clutch it stays where it is."""
    scale = settings.scale[i]
    opened = (int(row.command) & enable_state.CLUTCH) != 0
    if opened:
        world = kinematics.to_world(before, scale, memory.offset[i])
        memory.offset[i] = kinematics.clutched_offset(world, position, scale)
    row.position[i] = kinematics.to_world(position, scale, memory.offset[i])
    row.velocity[i] = 0.0 if opened else scale * velocity


@njit
def _walls(settings, memory, row):
    """Sum of all walls' forces, x and y."""
    row.force_walls[:] = 0.0
    for i in range(int(settings.walls)):
        nx, ny = settings.wall_x[i], settings.wall_y[i]
        depth = virtual_wall.wall_depth(nx, ny, settings.wall_offset[i], row.position[0], row.position[1])
        rate = -(nx * row.velocity[0] + ny * row.velocity[1])
        force = virtual_wall.wall_force(settings.wall_stiffness[i], settings.wall_damping[i], depth, rate)
        force *= 1.0 - memory.walls_off
        row.force_walls[0] += nx * force
        row.force_walls[1] += ny * force


@njit
def _coupling(settings, row):
    """Force of the virtual coupling on the handle, faded; its spring gives no more than the motor can hold."""
    for i in range(AXES):
        stretch = row.coupling_position[i] - row.position[i]
        rate = row.coupling_velocity[i] - row.velocity[i]
        force = virtual_coupling.spring_force(settings.stiffness[i], settings.coupling_limit[i], stretch)
        force += settings.damping[i] * rate
        row.force_coupling[i] = row.exchange_fade * force if i < settings.axes and row.exchange_fade > 0.0 else 0.0
        if settings.exchange_method != exchange_samples.WAVE:
            row.exchange_effort[i] = row.force_coupling[i]


@njit
def _cancellation(settings, memory, row):
    """Negative damping of the device's own, in free space only."""
    clearance = math.inf
    for i in range(int(settings.walls)):
        nx, ny = settings.wall_x[i], settings.wall_y[i]
        clearance = min(
            clearance, -virtual_wall.wall_depth(nx, ny, settings.wall_offset[i], row.position[0], row.position[1])
        )
    fade = damping_compensation.cancellation_fade(clearance, settings.cancellation_band, 0.0, 1.0)
    fade *= _left_by_coupling(settings, row)
    row.cancellation_fade = fade
    ratio = settings.cancellation_ratio * fade
    for i in range(int(settings.axes)):
        damping, velocity = settings.physical_damping[i], memory.device_velocity[i]
        if settings.cancellation_source == damping_compensation.MEASURED:
            force = damping_compensation.measured_cancellation_force(ratio, memory.drag[i], damping, velocity)
        else:
            force = damping_compensation.cancellation_force(ratio, damping, velocity)
        row.force_cancellation[i] = force / settings.scale[i]


@njit
def _left_by_coupling(settings, row):
    """Share of the cancellation that the coupling leaves: all without a tool, which then need not be anywhere."""
    if row.exchange_fade == 0.0:
        return 1.0
    stretch = math.hypot(row.coupling_position[0] - row.position[0], row.coupling_position[1] - row.position[1])
    twist = abs(row.coupling_position[2] - row.position[2]) if settings.axes > 2.0 else 0.0
    held = damping_compensation.cancellation_fade(math.inf, 1.0, stretch, settings.cancellation_stretch)
    held *= damping_compensation.cancellation_fade(math.inf, 1.0, twist, settings.cancellation_twist)
    return damping_compensation.share_beside_coupling(held, row.exchange_fade)


@njit
def _faults(settings, memory, row):
    """Latches the first fault; a new count of resets clears it."""
    command = int(row.command)
    resets = command // enable_state.RESET
    if resets != memory.resets:
        memory.resets, memory.fault, memory.saturated = resets, faults.NONE, 0.0
    if memory.fault == faults.NONE:
        if command & enable_state.ESTOP:
            memory.fault = faults.ESTOP
        elif max((row.deadline - row.latched) * 1e-9, memory.unseen * settings.period) > settings.silence:
            memory.fault = faults.DEVICE_SILENT
        elif int(row.device_status) & faults.WATCHDOG and memory.engage > 0.0:
            memory.fault = faults.DEVICE_WATCHDOG
        elif memory.saturated > settings.saturation:
            memory.fault = faults.SATURATION
        elif command & enable_state.UNATTENDED:
            memory.fault = faults.UNATTENDED
        elif max(memory.warmth[0], memory.warmth[1], memory.warmth[2]) > settings.duty * settings.duty:
            memory.fault = faults.DUTY
    row.fault = memory.fault


@njit
def _engage(settings, memory, row):
    """State and rise of the forces."""
    command = int(row.command)
    enabled = (command & enable_state.ENABLE) != 0 and (command & enable_state.CLUTCH) == 0
    wanted = math.hypot(row.force_walls[0] + row.force_coupling[0], row.force_walls[1] + row.force_coupling[1])
    small = wanted < settings.engage_force and abs(row.force_coupling[2]) < settings.engage_torque
    faulted = memory.fault != faults.NONE
    memory.state = enable_state.engage_state(int(memory.state), enabled, faulted, small, memory.engage)
    factor = enable_state.engage_factor(int(memory.state), memory.engage, settings.period, settings.engage_time)
    memory.engage = min(factor, memory.engage) if memory.unseen > 0.0 else factor  # nothing rises on old counts
    row.state, row.engage = memory.state, memory.engage


@njit
def _command_motor(settings, memory, row):
    """Total force, limited, to the device and into motor units; not finite is a fault and zero."""
    saturated = False
    for i in range(AXES):
        total = row.force_walls[i] + row.force_coupling[i] + row.force_cancellation[i] + row.force_passivity[i]
        if not abs(total) < math.inf:  # before any limit, which would make a force of it
            memory.fault = row.fault = memory.fault if memory.fault != faults.NONE else faults.NOT_A_NUMBER
        limit = settings.force_limit[i]
        force = kinematics.to_device_force(row.engage * min(limit, max(-limit, total)), settings.scale[i])
        row.force_gravity[i] = settings.gravity[i] if row.engage > 0.0 else 0.0
        force += row.engage * row.force_gravity[i]
        saturated |= i < settings.axes and abs(force) > settings.device_limit[i]
        memory.limited[i] = abs(total) > limit or abs(force) > settings.device_limit[i]
        memory.mixed[i] = memory.limited[i] and total != row.force_coupling[i]
        force = min(settings.device_limit[i], max(-settings.device_limit[i], force))
        row.force_on_handle[i] = force
    if memory.fault != faults.NONE:
        row.engage = memory.engage = 0.0
        row.state = memory.state = enable_state.FAULT
    for i in range(AXES):
        if memory.fault != faults.NONE or i >= settings.axes:
            row.force_on_handle[i] = 0.0
        row.motor[i] = row.force_on_handle[i] * settings.motor_per_force[i]
    memory.saturated = memory.saturated + settings.period if saturated else 0.0
    _warm(settings, memory, row)


@njit
def _warm(settings, memory, row):
    """Warmth of each motor after this tick's force."""
    for i in range(int(settings.axes)):
        share = row.force_on_handle[i] / settings.device_limit[i]
        memory.warmth[i] = faults.warmed(memory.warmth[i], share, settings.duty_kept)
        row.warmth[i] = memory.warmth[i]
