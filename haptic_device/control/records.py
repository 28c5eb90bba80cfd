# SPDX-License-Identifier: Apache-2.0
"""Records of a servo tick: what it is told (SETTINGS), what it keeps (STATE), what comes in and what goes out (TICK).

Each group of STATE belongs to one stage, the module that its comment names; a stage is handed the groups that it reads
or writes. All numbers are float64: `name*` is one per axis, `name#` one per wall, `name^` a history of samples.
"""

import numpy as np

from haptic_device.config.parameters import KEPT, MOST_WALLS
from haptic_device.control import contact_model, contact_solver, linkage
from haptic_device.control.rows import AXES, MOST, ROW

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
    " force_walls* force_coupling* force_cancellation* force_gravity*"
    " force_on_handle* motor*"  # the sum as the motor holds it, at the device; and in motor units
    " joint* torque*"  # of a linkage: its joints [rad], and what the motors hold there [N m]
    " engage exchange_fade cancellation_fade exchange_energy energy_given*"
    " exchange_effort* exchange_tank exchange_shortened exchange_released"  # next handle sample's; [J]; ticks
    " local local_fallbacks local_stays local_pivots tools_apart"  # acting; counts; of this tick; [m]
    " stored promised"  # by the springs; by what is on its way (account: S, Φ) [J]
    # of the damping [N s/m]; how late forces are taken to act [s], and |B| over T K that their weights are best for
    " margin* surplus* lateness_least lateness_counted lateness_ratio"
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
        ("linkage", linkage.LINKAGE),
        (
            "hardware",
            # of a linkage position_per_count, zero, motor_per_force, motor_limit are its joints' [rad, N m], all else,
            # with the largest force (most_force) and encoder step (step), the handle's at the worst pose.
            # stamp_error: counted beside delay
            record(
                "position_per_count* zero* scale* motor_per_force* motor_limit* gravity* damping* friction*"
                " position_low* position_high* velocity_limit* delay stamp_error most_force* step*"
            ),
        ),
        ("force", record("limit*")),
        ("coupling", record("stiffness* damping* limit*")),  # limit: largest force of its spring
        ("wall", record("count x# y# offset# stiffness# damping#")),
        ("cancellation", record("ratio band stretch twist source filter")),
        ("velocity", record("estimator lag window")),
        ("passivity", record("policy control lateness margin* surplus*")),
        # in the world: the device's damping, fastest speed and encoder step of each axis; of a linkage, of its so many
        # joints in place of x and y, and the most torque that a unit of force is (lever) [m]. What of the account is
        # told of the lateness (actuation_delay.set_lateness)
        (
            "port",
            record(
                "joints lever* damping* fastest* step* slew* period least most ratio whole holds",
                layers=(3, 4),
                needs=(4,),
            ),
        ),
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
ACCOUNT = record(
    # control/account [J]: free; stored (S), late (Φ) as sent, store, value (V) as weighed; deposit, sure, planned:
    # least of Φ, of its part in this hold, and that part; given: what the hand was given at most; energy_given: the
    # same by axis, as motion shows it. filled, unseen: 1 once it has begun, after old counts; overdue: holds for which
    # a late write counts; still: ticks without force; counted_*: the lateness of the last hold; sign: of the encoder's
    # step in V; short: of the coupling's force, over engage.force | engage.torque, where unpaid; least: of `needs`. By
    # axis: way, velocity of the hold; at the sample: spring, damper, was (sent before), own (by the handle's motion),
    # asked (wished), force (sent); damping that counts, left, T K (stiff), |B| (damp), more and lacks in a long hold;
    # what the encoder hides (blur, blur_now, blur_kept for blur_age ticks); beside, spring_before: of (2) at its ends;
    # followed, from_start: places with play and without. Of the window, which began `window` holds, `time` [s] and
    # `error` [ns] ago: gone, worst, fast, hazy (ways), earn, lossy (dampings), dim (blur), earned, single, lost.
    # shares: of the damping, as sent. Of a linkage: place, and jacobian of the world's handle, at the last sample.
    "filled free value store share unpaid counted_ratio late least stored deposit sure planned sign still"
    " shortened short unseen overdue counted_least counted_most window time error given damping* way* velocity*"
    " spring* damper* was* own* asked* force* left* stiff* damp* blur* blur_now* blur_kept* blur_age* gone* worst*"
    " earned* lost* earn* dim* fast* beside* spring_before* energy_given* followed* from_start* more* lacks* hazy*"
    " single* lossy* one_worst* place*",
    jacobian=(2, 2),
    shares=(HELD,),
    sent=(HELD, AXES),
)
STATE = np.dtype(
    [
        # sensing: device units but for handle*, which is in the world. Of this tick: time since the last sample
        # (elapsed), and by how much it may be another (unsure) [s]. Of a linkage: its joints, how far they turned, the
        # handle's jacobian at the device, and what is left of forces near a singular pose (unfaded)
        (
            "motion",
            record(
                "started sample_time sample_error stale_ticks elapsed unsure device_position* device_velocity* moved*"
                " handle* clutch_offset* clutched joint* joint_velocity* turned* unfaded",
                jacobian=(2, 2),
            ),
        ),
        ("samples", record("count times^ errors^ x^ y^ theta^")),
        ("compensation", record("drag*")),  # damping_compensation
        # motor: limit: of all force in the world, on its way to the one set; limited: whether it cut; acts: from when
        # each force of account.sent acts [ns, as samples are stamped]
        ("hold", record("deadline newest limit* limited*", acts=(HELD,))),
        # wishes; yielded: share of a row that it has let go of at a limit, and what that paid [J]
        ("walls", record("depth# paid", yielded=(MOST,), whole=(MOST,))),
        ("account", ACCOUNT),
        ("rows", ROW, (MOST,)),  # in force
        ("wished", ROW, (MOST,)),
        ("trial", ROW, (MOST,)),
        ("exchange", record("shipped returned tool_session tool_energy")),  # energies between the sides [J]
        # wishes; going: 1 while a setting in force is not the one that is wished for; walls: rows of them in force;
        # share: of their way in this tick, and of cancellation
        ("change", record("version going walls share")),
        ("enable", record("state ramp ramp_before")),  # enable_state
        ("fault", record("code resets saturated thermal_load*")),  # faults, motor
        ("fade", record("factor released apart")),  # exchange_controller; apart: nothing was felt since forces are on
        ("coupling", record("set_velocity*")),  # exchange_controller: at which the set position went
        (
            "virtual_tool",
            np.dtype(
                [
                    *record(
                        "acting well fallbacks stays unsolved pivots spare pose* velocity* mass* right* trial*"
                    ).descr,
                    ("system", "f8", (3, 4)),
                    ("contacts", CONTACTS),
                ]
            ),
        ),
    ]
)
