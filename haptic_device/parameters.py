# SPDX-License-Identifier: Apache-2.0
"""Parameters of the servo and of the operator's hand, a table for each law; readable without a compiler."""

from haptic_device.parameter import Parameter

SERVO = (
    Parameter("servo.rate", 4000.0, "Hz", "ticks of the servo loop per second", 500.0, 10000.0),
    Parameter("force.limit", 20.0, "N", "largest force on the handle, each of x and y", 0.0, 1000.0, True),
    Parameter("force.limit_rotational", 1.0, "N m", "largest torque on the handle", 0.0, 100.0, True),
    Parameter(
        "clutch.open", False, "", "let the device move without the handle in the world; no force meanwhile", live=True
    ),
)

COUPLING = (
    Parameter("coupling.stiffness", 1000.0, "N/m", "stiffness K between handle and tool, x and y", 0.0, 1e5, True),
    Parameter("coupling.damping", 1.0, "N s/m", "damping B between handle and tool, x and y", 0.0, 1e3, True),
    Parameter("coupling.rotational_stiffness", 1.0, "N m/rad", "stiffness about theta", 0.0, 1e3, True),
    Parameter("coupling.rotational_damping", 0.001, "N m s/rad", "damping about theta", 0.0, 10.0, True),
)

MOST_WALLS = 64  # walls; settings are a record of fixed size
WALL = (
    Parameter("wall.normals", (), "", "outward unit normals of all walls, flat: nx, ny of each", -1.0, 1.0, True),
    Parameter(
        "wall.offsets",
        (),
        "m",
        f"position of each wall along its normal, at most {MOST_WALLS} walls; the handle is free beyond it",
        -10.0,
        10.0,
        True,
    ),
    Parameter("wall.stiffness", (), "N/m", "stiffness K of each wall", 0.0, 1e6, True),
    Parameter("wall.damping", (), "N s/m", "damping B of each wall, backward difference", 0.0, 1e4, True),
)

SOURCES = ("model", "measured")
CANCELLATION = (
    Parameter("cancellation.ratio", 0.0, "", "part of the physical damping cancelled in free space", 0.0, 0.98, True),
    Parameter(
        "cancellation.source",
        "model",
        "",
        "drag as the device is described, or as measured",
        live=True,
        choices=SOURCES,
    ),
    Parameter("cancellation.filter", 0.002, "s", "time constant of the filter on measured drag", 0.0, 0.1, True),
    Parameter("cancellation.band", 0.005, "m", "distance before a wall over which it fades out", 1e-5, 1.0, True),
    Parameter("cancellation.twist", 0.01, "rad", "coupling twist at which it is faded out", 1e-5, 1.0, True),
    Parameter("cancellation.stretch", 0.001, "m", "coupling stretch at which it is faded out", 1e-6, 1.0, True),
)

ESTIMATORS = ("backward_difference", "lowpass", "adaptive_window")
KEPT = 33  # samples: windows of up to 32 ticks
ENCODER = (
    Parameter(
        "velocity.estimator",
        "backward_difference",
        "",
        "how velocity comes from position",
        live=True,
        choices=ESTIMATORS,
    ),
    Parameter("velocity.lag", 0.001, "s", "time constant of the lowpass estimate", 0.0, 0.1, True),
    Parameter("velocity.window", 16, "ticks", "longest adaptive window", 1, KEPT - 1, True),
)

ENGAGE = (
    Parameter("engage.time", 0.5, "s", "time over which forces rise after enabling", 0.01, 10.0, True),
    Parameter("engage.torque", 0.1, "N m", "and the wanted torque below this", 0.001, 10.0, True),
    Parameter("engage.force", 1.0, "N", "engaging begins only while the wanted force is below this", 0.01, 100.0, True),
)

EXCHANGE_METHODS = ("direct", "wave", "pspm", "local")
EXCHANGE = (
    Parameter("exchange.rate", 1000.0, "Hz", "handle samples sent to the simulation per second", 100.0, 2000.0),
    Parameter("exchange.method", "pspm", "", "what both sides do with each other's samples", choices=EXCHANGE_METHODS),
    Parameter("exchange.hold", 0.06, "s", "age up to which a tool sample is held at full force", 0.001, 2.0, True),
    Parameter("exchange.budget", 0.005, "J", "energy the coupling may give before the hand has paid any", 0.0, 1.0),
    Parameter("exchange.tank", 0.05, "J", "energy kept to pay for set positions; the rest is shipped", 0.0, 10.0),
    Parameter("exchange.horizon", 0.06, "s", "time over which the tool's motion is foretold, at most", 0.0, 0.5, True),
    Parameter("exchange.slew", 400.0, "N/s", "fastest change of force by the tool's samples alone", 1.0, 1e6, True),
    Parameter("exchange.agility", 20.0, "m/s^2", "acceleration that a free tool is given credit for", 0.0, 1e4, True),
    Parameter("exchange.fade", 0.14, "s", "time over which the coupling then lets go, and returns", 0.001, 5.0, True),
)

LOCAL = (
    Parameter("local.compliance", 1e-9, "m/N", "of a contact in the servo", 1e-10, 1e-5, True),
    Parameter(
        "local.apart",
        0.005,
        "m",
        "between the tools of servo and simulation, beyond which pspm takes over",
        1e-4,
        1.0,
        True,
    ),
    Parameter("local.hold", 0.06, "s", "age up to which local contacts count", 0.001, 2.0, True),
    Parameter("local.rejoin", 0.02, "s", "time for which all must be well before they count again", 0.0, 1.0, True),
)

POLICIES = ("enforce", "warn", "off")
PASSIVITY = (
    Parameter(
        "passivity.policy",
        "enforce",
        "",
        "gains beyond the device's damping are refused (enforce), said (warn) or taken (off)",
        live=True,
        choices=POLICIES,
    ),
    Parameter("passivity.control", True, "", "inject damping when the observer finds energy generated", live=True),
    Parameter(
        "passivity.budget", 0.001, "J", "energy generated, per axis, before damping is injected", 0.0, 10.0, True
    ),
)

FAULT = (
    Parameter(
        "fault.silence", 0.02, "s", "time without an answer of the device that latches device_silent", 0.001, 1.0
    ),
    Parameter(
        "fault.saturation", 1.0, "s", "time of wanting more than the motor limit before saturation", 0.01, 60.0, True
    ),
    Parameter(
        "fault.duty", 1.0, "", "share of the motor limit that may be held for ever; more latches duty", 0.01, 1.0, True
    ),
    Parameter("fault.duty_time", 20.0, "s", "time constant of a motor's warmth", 0.01, 3600.0, True),
    Parameter(
        "fault.unattended",
        5.0,
        "s",
        "time for which the thread that serves the node stood still that latches unattended; 0: never",
        0.0,
        3600.0,
    ),
)

SCRIPTS = ("hold", "insert_peg", "press_wall", "tap", "circle", "let_go", "follow")
OPERATOR = (
    Parameter("hand.mass", 0.1, "kg", "mass of the hand that moves with the handle, x and y", 0.0, 10.0),
    Parameter("hand.damping", 8.0, "N s/m", "damper between the hand's target and the handle", 0.0, 500.0),
    Parameter("hand.stiffness", 500.0, "N/m", "spring between the hand's target and the handle", 0.0, 10000.0),
    Parameter("hand.rotational_mass", 0.0001, "kg m^2", "inertia of the hand about theta", 0.0, 1.0),
    Parameter("hand.rotational_damping", 0.02, "N m s/rad", "damper about theta", 0.0, 10.0),
    Parameter("hand.rotational_stiffness", 1.0, "N m/rad", "spring about theta", 0.0, 1000.0),
    Parameter("motion.name", "hold", "", "the hand's script; follow: it runs after operator/target", choices=SCRIPTS),
    Parameter("motion.start", (0.0, 0.0, 0.0), "m, m, rad", "where handle and hand begin", -10.0, 10.0),
    Parameter("motion.target", (0.0, 0.0, 0.0), "m, m, rad", "where the script leads", -1000.0, 1000.0),
    Parameter("motion.duration", 4.0, "s", "time of the whole script", 0.1, 36000.0),
    Parameter("motion.radius", 0.03, "m", "of the circle, whose rightmost point is motion.start", 0.0, 1.0),
    Parameter("motion.turns", 4.0, "", "turns of the circle", 0.0, 10000.0),
    Parameter("motion.taps", 5, "", "how often tap goes to the target and back", 1, 15),
    Parameter("motion.lag", 0.01, "s", "time constant with which follow runs after the target", 0.001, 1.0),
)
OPERATING_POINT = (
    *SERVO,
    *COUPLING,
    *WALL,
    *CANCELLATION,
    *ENCODER,
    *ENGAGE,
    *EXCHANGE,
    *LOCAL,
    *PASSIVITY,
    *FAULT,
)
"""What a driver's servo is told, all tables together."""
