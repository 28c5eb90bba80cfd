# SPDX-License-Identifier: Apache-2.0
"""The parameters of the device's nodes, each declared once; readable without ROS and without a compiler.

A class is a group: its name in the node's model, a dot and the name of the field are the parameter's name, as in
coupling.stiffness. Descriptors, the check of files, the table of docs and the control record are read from these lines.
"""

from typing import Literal, get_args

from haptic_device.config.parameter_types import Group, Parameter, Watched, fixed, limits_of, live, parameters_of

MOST_WALLS = 64  # walls; settings are a record of fixed size
MOST_WAYPOINTS = 31  # of the hand, after its start
LEAST_UNATTENDED = 0.2  # s; the driver says each twentieth of a second that it is there
KEPT = 33  # samples: windows of up to 32 ticks

Numbers = tuple[float, ...]
Source = Literal["model", "measured"]
Estimator = Literal["backward_difference", "lowpass", "adaptive_window"]
ExchangeMethod = Literal["direct", "pspm", "local"]
Policy = Literal["enforce", "warn", "off"]
Script = Literal["hold", "insert_peg", "press_wall", "tap", "circle", "let_go", "waypoints", "follow"]
Realtime = Literal["require", "prefer", "off"]
SOURCES, ESTIMATORS, EXCHANGE_METHODS = get_args(Source), get_args(Estimator), get_args(ExchangeMethod)
POLICIES, SCRIPTS = get_args(Policy), get_args(Script)


class Servo(Group):
    """Rate of the servo."""

    rate: float = fixed(4000.0, "Hz", "ticks of the servo loop per second", 500.0, 10000.0)


class Force(Group):
    """Largest force and torque on the handle."""

    limit: float = live(20.0, "N", "largest force on the handle, each of x and y", 0.0, 1000.0, 50.0)
    limit_rotational: float = live(1.0, "N m", "largest torque on the handle", 0.0, 100.0, 2.0)


class Clutch(Group):
    """Separates the handle from the world."""

    open: bool = live(False, "", "true: the device moves, but the handle in the world does not; no force acts")


class Coupling(Group):
    """Spring and damper between handle and tool."""

    stiffness: float = live(1000.0, "N/m", "stiffness K between handle and tool, x and y", 0.0, 1e5, 5000.0)
    damping: float = live(1.0, "N s/m", "damping B between handle and tool, x and y", 0.0, 1000.0, 10.0)
    rotational_stiffness: float = live(1.0, "N m/rad", "stiffness K about theta", 0.0, 1000.0, 10.0)
    rotational_damping: float = live(0.001, "N m s/rad", "damping B about theta", 0.0, 10.0, 0.02)


class Wall(Group):
    """Walls that the servo renders by itself."""

    normals: Numbers = live((), "", "outward unit normals of all walls in one list: nx, ny of each wall", -1.0, 1.0)
    offsets: Numbers = live(
        (),
        "m",
        f"position of each wall along its normal; the handle is free beyond it; at most {MOST_WALLS} walls",
        -10.0,
        10.0,
    )
    stiffness: Numbers = live((), "N/m", "stiffness K of each wall", 0.0, 1e6, 5000.0)
    damping: Numbers = live(
        (), "N s/m", "damping B of each wall, on the backward difference of position", 0.0, 10000.0, 10.0
    )


class Cancellation(Group):
    """How much of the device's damping the motors compensate, and where."""

    ratio: float = live(0.0, "", "share of the physical damping that the motors cancel in free space", 0.0, 0.98)
    source: Source = live("model", "", "drag to cancel: of the device description (model), or of the drag sensor")
    filter: float = live(0.002, "s", "time constant of the filter of the measured drag", 0.0, 0.1, 0.02)
    band: float = live(0.005, "m", "distance to a wall below which cancellation fades out", 1e-5, 1.0, 0.02)
    twist: float = live(0.01, "rad", "twist of the coupling at which cancellation is zero", 1e-5, 1.0, 0.1)
    stretch: float = live(0.001, "m", "stretch of the coupling at which cancellation is zero", 1e-6, 1.0, 0.01)


class Velocity(Group):
    """Estimate of the velocity."""

    estimator: Estimator = live("backward_difference", "", "method that estimates the velocity")
    lag: float = live(0.001, "s", "time constant of the estimator lowpass", 0.0, 0.1, 0.02)
    window: int = live(16, "ticks", "longest window of the estimator adaptive_window", 1, KEPT - 1)


class Engage(Group):
    """How forces begin after enabling."""

    time: float = live(0.5, "s", "time over which forces rise after enabling", 0.01, 10.0, 3.0)
    torque: float = live(0.1, "N m", "forces begin to rise only when the wanted torque is below this", 0.001, 10.0, 0.5)
    force: float = live(1.0, "N", "forces begin to rise only when the wanted force is below this", 0.01, 100.0, 10.0)


class Exchange(Group):
    """Exchange of samples with the simulation."""

    rate: float = fixed(
        1000.0, "Hz", "handle samples sent to the simulation per second, at most one in each tick", 100.0, 2000.0
    )
    method: ExchangeMethod = fixed("pspm", "", "method of the exchange between driver and simulation")
    hold: float = live(
        0.06, "s", "age of the tool sample up to which the coupling keeps its full force", 0.001, 2.0, 0.3
    )
    budget: float = fixed(0.005, "J", "energy that the coupling may give before the hand has put in any", 0.0, 1.0)
    tank: float = fixed(0.05, "J", "most energy that the tank keeps for set positions; the rest is sent", 0.0, 10.0)
    horizon: float = live(0.06, "s", "longest time over which the tool's motion is predicted", 0.0, 0.5, 0.2)
    slew: float = live(400.0, "N/s", "fastest change of the force by tool samples alone", 1.0, 1e6, 5000.0)
    agility: float = live(
        20.0, "m/s^2", "acceleration that the prediction assumes for a free tool", 0.0, 10000.0, 200.0
    )
    fade: float = live(
        0.14, "s", "time in which the coupling fades out after exchange.hold, and back in", 0.001, 5.0, 1.0
    )


class Local(Group):
    """Contacts of the servo's own virtual tool."""

    compliance: float = live(1e-9, "m/N", "compliance of a contact of the servo's copy of the tool", 1e-10, 1e-5, 1e-6)
    apart: float = live(
        0.005, "m", "distance between the copy and the simulation's tool above which pspm takes over", 1e-4, 1.0, 0.05
    )
    hold: float = live(0.06, "s", "age up to which local contacts are used", 0.001, 2.0, 0.3)
    rejoin: float = live(0.02, "s", "time without a problem after which local contacts are used again", 0.0, 1.0, 0.5)


class Passivity(Group):
    """What keeps the display passive."""

    policy: Policy = live(
        "enforce", "", "gains too high for the device's damping: refuse (enforce), warn, or take at once (off)"
    )
    control: bool = live(True, "", "true: springs let go of what they owe, as after a missed tick")


class Fault(Group):
    """Limits beyond which a fault is latched."""

    silence: float = fixed(0.02, "s", "time without an answer of the device that latches device_silent", 0.001, 1.0)
    saturation: float = live(1.0, "s", "time above the motor limit that latches saturation", 0.01, 60.0, 10.0)
    duty: float = live(1.0, "", "share of the motor limit that may act for ever; more latches duty", 0.01, 1.0)
    duty_time: float = live(20.0, "s", "time constant of a motor's thermal load", 0.01, 3600.0, 120.0)
    unattended: float = fixed(
        5.0,
        "s",
        f"standstill of the node's thread that latches unattended: at least {LEAST_UNATTENDED}, or 0 for never",
        0.0,
        3600.0,
    )


class Hand(Group):
    """Mechanics of the simulated hand."""

    mass: float = fixed(0.1, "kg", "mass of the hand that moves with the handle, x and y", 0.0, 10.0)
    damping: float = fixed(8.0, "N s/m", "damper between the hand's target and the handle", 0.0, 500.0)
    stiffness: float = fixed(500.0, "N/m", "spring between the hand's target and the handle", 0.0, 10000.0)
    rotational_mass: float = fixed(0.0001, "kg m^2", "inertia of the hand about theta", 0.0, 1.0)
    rotational_damping: float = fixed(0.02, "N m s/rad", "damper about theta", 0.0, 10.0)
    rotational_stiffness: float = fixed(1.0, "N m/rad", "spring about theta", 0.0, 1000.0)


class Motion(Group):
    """Script of the simulated hand."""

    name: Script = fixed("hold", "", "script of the hand; follow: the hand follows operator/target")
    start: Numbers = fixed((0.0, 0.0, 0.0), "m, m, rad", "position of handle and hand at the start", -10.0, 10.0)
    target: Numbers = fixed((0.0, 0.0, 0.0), "m, m, rad", "position to which the script leads", -1000.0, 1000.0)
    waypoints: Numbers = fixed(
        (),
        "m, m, rad",
        f"points of the script waypoints in one list: x, y, theta of each; at most {MOST_WAYPOINTS}",
        -1000.0,
        1000.0,
    )
    duration: float = fixed(4.0, "s", "duration of the whole script", 0.1, 36000.0)
    radius: float = fixed(0.03, "m", "radius of the circle; motion.start is its rightmost point", 0.0, 1.0)
    turns: float = fixed(4.0, "", "number of turns of the script circle", 0.0, 10000.0)
    taps: int = fixed(5, "", "number of times that the script tap goes to the target and back", 1, 15)
    lag: float = fixed(0.01, "s", "time constant with which the script follow follows its target", 0.001, 1.0)


class OperatingPoint(Group):
    """What a driver's servo is told."""

    servo: Servo
    force: Force
    clutch: Clutch
    coupling: Coupling
    wall: Wall
    cancellation: Cancellation
    velocity: Velocity
    engage: Engage
    exchange: Exchange
    local: Local
    passivity: Passivity
    fault: Fault


class Operator(Group):
    """What a loopback's hand is told."""

    hand: Hand
    motion: Motion


class Common(Group):
    """What driver and loopback share."""

    device: str = fixed("desktop", "", "device description: a file, or a name in config/devices")
    autostart: bool = fixed(True, "", "true: the node configures and activates itself")
    realtime: Realtime = fixed("prefer", "", "real-time scheduling (SCHED_FIFO) and locked memory")


class DriverTopics(Group):
    """What a driver publishes."""

    rate: float = fixed(500.0, "Hz", "messages per second on encoder and motor", 1.0, 1000.0)
    pose_rate: float = fixed(100.0, "Hz", "messages per second on wrench, pose and joint_states", 1.0, 1000.0)
    trace: bool = fixed(True, "", "true: publish every tick on trace, in blocks")


class Driver(OperatingPoint, Common):
    """haptic_driver; the fields of the last base come first."""

    auto_enable: bool = fixed(False, "", "true: enable once when the device answers, unless a person stopped it")
    auto_enable_wait: float = fixed(
        0.0, "s", "longest time that auto_enable waits for the first tool sample", 0.0, 600.0
    )
    publish: DriverTopics


class DeviceTopics(Group):
    """What a simulated device publishes."""

    rate: float = fixed(500.0, "Hz", "messages per second on operator/state", 1.0, 1000.0)


class Loopback(Operator, Common):
    """haptic_loopback."""

    motor_watchdog: float = fixed(0.015, "s", "time without a write after which the motor is cut", 0.001, 10.0)
    publish: DeviceTopics


class Bridge(Common):
    """haptic_bridge."""

    port: str = fixed("", "", "serial port, UDP port or HOST:PORT; replaces that of the device description")
    motor_watchdog: float = fixed(
        0.015, "s", "time without a write after which the bridge sets the motor to zero", 0.001, 10.0
    )
    publish: DeviceTopics


class Split(Group):
    """When a bag begins a new file."""

    size: float = fixed(2000.0, "MB", "size at which a new file begins; 0: never", 0.0, 1e6)
    duration: float = fixed(0.0, "s", "time after which a new file begins; 0: never", 0.0, 1e6)


class Trial(Group):
    """Facts of an experiment."""

    participant: str = live("", "", "code of the participant, written into the next bag")
    condition: str = live("", "", "experimental condition, written into the next bag")
    fields: tuple[str, ...] = live(("",), "", "other facts of the trial, each as name=value")


class Recorder(Group):
    """haptic_recorder."""

    autostart: bool = fixed(True, "", "true: the node configures and activates itself")
    realtime: Realtime = fixed("prefer", "", "real-time scheduling, and one core for all its threads")
    bag: str = fixed("", "", "folder of the bag, new or empty; without a name haptic_bags/<date>-<time>")
    queue: int = fixed(2000, "messages", "messages of each topic that may wait between two reads", 1, 100000)
    look_period: float = fixed(0.04, "s", "time between two reads of the queues", 0.001, 0.5)
    flush_period: float = fixed(
        0.25, "s", "time between two writes to disk: if the process is killed, this much can be lost", 0.02, 0.75
    )
    split: Split
    disk_reserve: float = fixed(200.0, "MB", "free space below which recording stops and completes its bag", 0.0, 1e6)
    trial: Trial


DRIVER_FIGURES = (
    Watched(
        "margin",
        "N s/m",
        "physical damping that the gains leave in the worst direction, at the measured lateness",
        0.0,
        -1.0,
    ),
    Watched("margin_theta", "N m s/rad", "the same about theta, for a device with theta", 0.0, -0.001),
    Watched("lateness", "s", "wake-up of the servo after its deadline, 99 %", 1e-4, 1e-3),
    Watched("compute", "s", "computing time of a tick, 99 %", 5e-5, 1e-4),
    Watched("missed", "1/s", "missed ticks", 1.0, 100.0),
    Watched("age", "s", "age of the tool sample in use, 99 %", 0.01, 0.06),
    Watched("loss", "", "share of the handle samples that were not answered", 0.1, 0.5),
    Watched("energy", "J", "energy given to the operator, as the servo counts it", 0.01, 0.1),
    Watched("thermal_load", "", "largest thermal load of a motor; 1: the load of a motor held at its limit", 0.6, 0.9),
    Watched("stall", "s", "longest standstill of the Python thread that serves requests", 0.2, 1.0),
    Watched("skipped", "", "share of the samples of encoder, motor, wrench and pose that were not published", 0.1, 0.9),
    Watched("dropped", "", "share of the rows of trace that were not published", 0.0, 0.5),
)
LOOPBACK_FIGURES = (
    Watched("energy", "J", "energy given to the operator, from the simulated device", 0.01, 0.1),
    Watched("run_on", "1/s", "deadlines that passed without a write of the servo", 1.0, 100.0),
    Watched("late_writes", "1/s", "writes that came after the simulation had passed their time", 1.0, 100.0),
)

BRIDGE_FIGURES = (
    Watched("delay", "s", "time from the servo's write to the motor's effect, 99 %", 1e-3, 5e-3),
    Watched("clock_error", "s", "uncertainty of the device's clock", 1e-4, 1e-3),
    Watched("lost", "1/s", "deadlines without a sample", 1.0, 100.0),
    Watched("run_on", "1/s", "deadlines that passed without a write of the servo", 1.0, 100.0),
)

OPERATING_POINT, OPERATOR = parameters_of(OperatingPoint), parameters_of(Operator)
DRIVER = (*parameters_of(Driver), *limits_of(DRIVER_FIGURES))
LOOPBACK = (*parameters_of(Loopback), *limits_of(LOOPBACK_FIGURES))
BRIDGE = (*parameters_of(Bridge), *limits_of(BRIDGE_FIGURES))
RECORDER = parameters_of(Recorder)
NODES: dict[str, tuple[Parameter, ...]] = {
    "haptic_bridge": BRIDGE,
    "haptic_driver": DRIVER,
    "haptic_loopback": LOOPBACK,
    "haptic_recorder": RECORDER,
}
