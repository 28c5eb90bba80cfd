# SPDX-License-Identifier: Apache-2.0
"""Records of a servo tick: what it is told (SETTINGS), what it keeps (STATE), what comes in and what goes out (TICK).

Each group of STATE belongs to one stage, the module that its comment names; a stage is handed the groups that it reads
or writes. All numbers are float64: `name*` is one per axis, `name#` one per wall, `name^` a history of samples.
"""

import numpy as np

from haptic_device.config.parameters import KEPT, MOST_WALLS
from haptic_device.control import contact_model, contact_solver

AXES = 3  # x, y, theta; a device with fewer leaves the rest at zero
HELD = 64  # motor values that may be on their way at a time
PUSHES = 64  # ticks for which the virtual tool's pushes against movable bodies are remembered
_WIDTHS = {"*": (AXES,), "#": (MOST_WALLS,), "^": (KEPT,)}


def record(names: str, **tables) -> np.dtype:
    """Type of a record of these columns, and of tables of the shapes given."""
    split = [(name.rstrip("*#^"), _WIDTHS.get(name[-1], ())) for name in names.split()]
    return np.dtype([(name, "f8", shape) for name, shape in (*split, *tables.items())])


SENSORS = record(  # deadline, latched [ns of CLOCK_MONOTONIC]; lateness, compute (of the tick before), write_delay [s];
    # stamp_error: half-width of what is not known of latched [ns]
    "tick deadline lateness compute write_delay missed parameter_version command latched stamp_error"
    " counts* drag* device_status"
)
TOOL_SAMPLE = record(  # the simulation's newest answer; contact_*: the set of local contacts that counts; ages [s]
    "session sequence answered age position* velocity* effort* contact energy contact_set contact_age handle_sequence"
)
OUTPUT = record(
    "position* velocity* coupling_position* coupling_velocity*"  # of the handle, and what the coupling pulls to
    " force_walls* force_coupling* force_cancellation* force_passivity* force_gravity*"
    " force_on_handle* motor*"  # the sum as the motor holds it, at the device; and in motor units
    " engage exchange_fade cancellation_fade exchange_energy energy_given*"
    " exchange_effort* exchange_tank exchange_shortened exchange_released"  # next handle sample's; [J]; ticks
    " local local_fallbacks local_stays local_pivots tools_apart"  # acting; counts; of this tick; [m]
    " generated* injected* injections"  # observer [J], controller [N s/m], ticks it acted
    " margin* surplus* lateness_counted"  # of the physical damping [N s/m]; how late forces are taken to act [s]
    " state fault thermal_load* withheld"  # withheld: sum of bits (control/withheld)
)
TICK = np.dtype((np.record, [("sensors", SENSORS), ("tool", TOOL_SAMPLE), ("output", OUTPUT)]))
_NOT_PREFIXED = {"contact_set", "contact_age", "handle_sequence"}
TRACE_ROW = np.dtype(
    [
        (f"tool_{name}" if group == "tool" and name not in _NOT_PREFIXED else name, "f8", part[name].shape)
        for group, part in ((name, TICK[name]) for name in TICK.names)
        for name in part.names
    ]
)
"""TICK as one flat row, the columns of the trace: the same bytes."""

SETTINGS = np.dtype(
    [
        *((name, "f8") for name in ("version", "period", "axes")),
        (
            "hardware",
            record(
                "position_per_count* zero* scale* motor_per_force* motor_limit* gravity* damping*"
                " position_low* position_high* velocity_limit* delay stamp_error"  # stamp_error: counted beside delay
            ),
        ),
        ("force", record("limit*")),
        ("coupling", record("stiffness* damping* limit*")),  # limit: largest force of its spring
        ("wall", record("count x# y# offset# stiffness# damping#")),
        ("cancellation", record("ratio band stretch twist source filter")),
        ("velocity", record("estimator lag window")),
        ("passivity", record("policy control budget lateness margin* surplus* cross")),
        ("exchange", record("method budget tank horizon slew* agility* hold fade")),
        ("local", record("compliance apart hold rejoin")),
        ("engage", record("time force torque")),
        ("fault", record("silence saturation duty duty_kept unattended")),
    ]
)
"""Groups and names are those of the parameters, where there is one."""

CONTACTS = record(
    "number sent trust mass inertia extent gravity* pose* fresh turn",
    table=(contact_model.MOST, len(contact_model.EACH)),
    places=(contact_model.MOST, contact_model.PLACE),
    constraints=(contact_model.MOST, contact_solver.COLUMNS),
    shown=(contact_model.MOST,),
    pushed=(contact_model.MOST,),
    shifted=(contact_model.MOST,),
    pushes=(contact_model.MOST, PUSHES),
    shifts=(contact_model.MOST, PUSHES),
)
STATE = np.dtype(
    [
        # sensing: device units but for handle*, which is in the world. Of this tick: handle_before; time since the last
        # sample (elapsed), by how much it may be another (unsure), and without missed ticks (held) [s]
        (
            "motion",
            record(
                "started sample_time sample_error sample_deadline stale_ticks elapsed unsure held device_position*"
                " device_velocity* moved* handle* handle_before* clutch_offset* clutched"
            ),
        ),
        ("samples", record("count times^ errors^ x^ y^ theta^")),
        ("compensation", record("drag*")),  # damping_compensation
        # motor: what was held since the last sample, and by how much and how long it was not the first of it;
        # wall_springs, wall_dampers, coupling_spring: wanted, in the world; clipped: what the limits leave out of the
        # walls' springs; walls: what acts of all walls, both in the world; coupling: what acts of it, at the device;
        # rest_share: of all other dampers, what acts; cancelling: share 0…1 of the damping that is cancelled;
        # cancellation_force: what acts of it, at the device [N | N m], along the motion; written, acts: motor values on
        # their way, and from when each acts [ns, as samples are stamped]
        (
            "hold",
            record(
                "deadline regained force* force_now* change* square* limited* newest newest_way"
                " wall_springs* wall_dampers* coupling_spring* clipped* walls* coupling* rest_share*"
                " cancellation_force* cancelling",
                acts=(HELD,),
                written=(HELD, AXES),
                coupling_written=(HELD, AXES),
                ways=(HELD, AXES),
            ),
        ),
        ("walls", record("depth# release yielded touched")),  # virtual_wall; shares of them that are gone
        (
            "observer",  # passivity_observer
            record(
                "energy_given* pulled_to* coupled cancelled* damping_credit growth* damper* store* observed_energy*"
                " injections missed_tick_energy springs* by_settings* paid*"
            ),
        ),
        ("enable", record("state ramp ramp_before")),  # enable_state
        ("in_force", SETTINGS),  # bumpless_transfer
        ("change", record("going")),  # how many settings in force are not yet those that are wished for
        ("fault", record("code resets saturated thermal_load*")),  # faults, motor
        ("fade", record("factor released apart")),  # exchange_controller; apart: nothing was felt since forces are on
        # the coupling's spring as the energy tank has paid for it; factor: on its force; force, push, damped: as they
        # were in the last tick, B times the set position's velocity and the handle's [N | N m]; changed: by it;
        # prepaid: for changes that still act late [J]; parted: 1 where it was released within the hold; slack: ticks
        # for which nothing of it has pulled
        (
            "spring",
            record(
                "factor factor_held stiffness* limit* push* damped* set_position* set_velocity* own_velocity* goal*"
                " stretch* force* changed* prepaid* parted slack"
            ),
        ),
        (
            # energy_tank; short: force that it did not pay for in this tick, over engage.force | engage.torque; own:
            # the coupling's share of the physical damping [N s/m | N m s/rad]; given: what the coupling has given to
            # the hand at most [J], negative where the hand has lost; followed: place of the handle at the device, with
            # half an encoder step of play [m | rad]
            "tank",
            record(
                "filled version level owed shipped returned tool_session tool_energy shortened"
                " short lateness left* price* surplus* own* given followed*"
                " midpoint* window_from* window_start window_error window_holds counted* sample_before hold_before"
            ),
        ),
        (
            "virtual_tool",
            np.dtype(
                [
                    *record("acting well fallbacks stays unsolved pivots pose* velocity* mass* right* trial*").descr,
                    ("system", "f8", (3, 4)),
                    ("contacts", CONTACTS),
                ]
            ),
        ),
    ]
)
