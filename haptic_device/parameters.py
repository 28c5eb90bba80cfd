# SPDX-License-Identifier: Apache-2.0
"""The parameters of the device's nodes, each declared once; readable without ROS and without a compiler.

A class is a group: its name in the node's model, a dot and the name of the field are the parameter's name, as in
coupling.stiffness. Descriptors, the check of files, the table of docs and the control record are read from these lines.
"""

from typing import Annotated, Literal, get_args

from pydantic import Field

from haptic_device.parameter_types import Group, Parameter, Watched, fixed, limits_of, live, parameters_of

MOST_WALLS = 64  # walls; settings are a record of fixed size
MOST_WAYPOINTS = 31  # of the hand, after its start
KEPT = 33  # samples: windows of up to 32 ticks

Source = Literal["model", "measured"]
Estimator = Literal["backward_difference", "lowpass", "adaptive_window"]
ExchangeMethod = Literal["direct", "wave", "pspm", "local"]
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

    limit: float = live(20.0, "N", "largest force on the handle, each of x and y", 0.0, 1000.0)
    limit_rotational: float = live(1.0, "N m", "largest torque on the handle", 0.0, 100.0)


class Clutch(Group):
    """Separates the handle from the world."""

    open: bool = live(False, "", "let the device move without the handle in the world; no force meanwhile")


class Coupling(Group):
    """Spring and damper between handle and tool."""

    stiffness: float = live(1000.0, "N/m", "stiffness K between handle and tool, x and y", 0.0, 1e5)
    damping: float = live(1.0, "N s/m", "damping B between handle and tool, x and y", 0.0, 1000.0)
    rotational_stiffness: float = live(1.0, "N m/rad", "stiffness about theta", 0.0, 1000.0)
    rotational_damping: float = live(0.001, "N m s/rad", "damping about theta", 0.0, 10.0)


class Wall(Group):
    """Walls that the servo renders by itself."""

    normals: tuple[Annotated[float, Field(ge=-1.0, le=1.0)], ...] = live(
        (), "", "outward unit normals of all walls, flat: nx, ny of each"
    )
    offsets: tuple[Annotated[float, Field(ge=-10.0, le=10.0)], ...] = live(
        (), "m", f"position of each wall along its normal, at most {MOST_WALLS} walls; the handle is free beyond it"
    )
    stiffness: tuple[Annotated[float, Field(ge=0.0, le=1e6)], ...] = live((), "N/m", "stiffness K of each wall")
    damping: tuple[Annotated[float, Field(ge=0.0, le=10000.0)], ...] = live(
        (), "N s/m", "damping B of each wall, backward difference"
    )


class Cancellation(Group):
    """How much of the device's damping the motors compensate, and where."""

    ratio: float = live(0.0, "", "part of the physical damping cancelled in free space", 0.0, 0.98)
    source: Source = live("model", "", "drag as the device is described, or as measured")
    filter: float = live(0.002, "s", "time constant of the filter on measured drag", 0.0, 0.1)
    band: float = live(0.005, "m", "distance before a wall over which cancellation fades out", 1e-5, 1.0)
    twist: float = live(0.01, "rad", "coupling twist at which cancellation has faded out", 1e-5, 1.0)
    stretch: float = live(0.001, "m", "coupling stretch at which cancellation has faded out", 1e-6, 1.0)


class Velocity(Group):
    """Estimate of the velocity."""

    estimator: Estimator = live("backward_difference", "", "how velocity comes from position")
    lag: float = live(0.001, "s", "time constant of the lowpass estimate", 0.0, 0.1)
    window: int = live(16, "ticks", "longest adaptive window", 1, KEPT - 1)


class Engage(Group):
    """How forces begin after enabling."""

    time: float = live(0.5, "s", "time over which forces rise after enabling", 0.01, 10.0)
    torque: float = live(0.1, "N m", "engaging begins only while the wanted torque is below this", 0.001, 10.0)
    force: float = live(1.0, "N", "engaging begins only while the wanted force is below this", 0.01, 100.0)


class Exchange(Group):
    """Exchange of samples with the simulation."""

    rate: float = fixed(
        1000.0, "Hz", "handle samples sent to the simulation per second, at most one a servo tick", 100.0, 2000.0
    )
    method: ExchangeMethod = fixed("pspm", "", "what both sides do with each other's samples")
    hold: float = live(0.06, "s", "age up to which a tool sample is held at full force", 0.001, 2.0)
    budget: float = fixed(0.005, "J", "energy the coupling may give before the hand has paid any", 0.0, 1.0)
    tank: float = fixed(0.05, "J", "energy kept to pay for set positions; the rest is shipped", 0.0, 10.0)
    horizon: float = live(0.06, "s", "longest time over which the tool's motion is predicted", 0.0, 0.5)
    slew: float = live(400.0, "N/s", "fastest change of force by the tool's samples alone", 1.0, 1e6)
    agility: float = live(20.0, "m/s^2", "acceleration that a free tool is given credit for", 0.0, 10000.0)
    fade: float = live(0.14, "s", "time in which the coupling fades out after exchange.hold, and in", 0.001, 5.0)


class Local(Group):
    """Contacts of the servo's own virtual tool."""

    compliance: float = live(1e-9, "m/N", "compliance of a contact in the servo", 1e-10, 1e-5)
    apart: float = live(
        0.005, "m", "distance between the tools of servo and simulation beyond which pspm takes over", 1e-4, 1.0
    )
    hold: float = live(0.06, "s", "age up to which local contacts count", 0.001, 2.0)
    rejoin: float = live(0.02, "s", "time for which all must be well before they count again", 0.0, 1.0)


class Passivity(Group):
    """What keeps the display passive."""

    policy: Policy = live(
        "enforce", "", "gains beyond the device's damping are refused (enforce), said (warn) or taken, at once (off)"
    )
    control: bool = live(True, "", "inject damping when the observer finds energy generated")
    budget: float = live(0.001, "J", "energy generated, per axis, before damping is injected", 0.0, 10.0)


class Fault(Group):
    """Limits beyond which a fault is latched."""

    silence: float = fixed(0.02, "s", "time without an answer of the device which latches device_silent", 0.001, 1.0)
    saturation: float = live(1.0, "s", "time of wanting more than the motor limit before saturation", 0.01, 60.0)
    duty: float = live(1.0, "", "share of the motor limit that may be held for ever; more latches duty", 0.01, 1.0)
    duty_time: float = live(20.0, "s", "time constant of a motor's thermal load", 0.01, 3600.0)
    unattended: float = fixed(
        5.0,
        "s",
        "longest standstill, at least 0.2, of the thread that serves the node; then unattended is latched; 0: never",
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

    name: Script = fixed("hold", "", "the hand's script; follow: it runs after operator/target")
    start: tuple[Annotated[float, Field(ge=-10.0, le=10.0)], ...] = fixed(
        (0.0, 0.0, 0.0), "m, m, rad", "where handle and hand begin"
    )
    target: tuple[Annotated[float, Field(ge=-1000.0, le=1000.0)], ...] = fixed(
        (0.0, 0.0, 0.0), "m, m, rad", "where the script leads"
    )
    waypoints: tuple[Annotated[float, Field(ge=-1000.0, le=1000.0)], ...] = fixed(
        (), "m, m, rad", f"where the script waypoints leads, flat: x, y, theta of each; at most {MOST_WAYPOINTS}"
    )
    duration: float = fixed(4.0, "s", "time of the whole script", 0.1, 36000.0)
    radius: float = fixed(0.03, "m", "radius of the circle, whose rightmost point is motion.start", 0.0, 1.0)
    turns: float = fixed(4.0, "", "turns of the circle", 0.0, 10000.0)
    taps: int = fixed(5, "", "how often tap goes to the target and back", 1, 15)
    lag: float = fixed(0.01, "s", "time constant with which follow runs after the target", 0.001, 1.0)


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
    autostart: bool = fixed(True, "", "configure and activate by itself")
    realtime: Realtime = fixed("prefer", "", "SCHED_FIFO, locked memory, timer slack")


class DriverTopics(Group):
    """What a driver publishes."""

    rate: float = fixed(500.0, "Hz", "encoder and motor", 1.0, 1000.0)
    pose_rate: float = fixed(100.0, "Hz", "wrench and pose", 1.0, 1000.0)
    trace: bool = fixed(True, "", "publish every tick in blocks on trace")


class Driver(OperatingPoint, Common):
    """haptic_driver; the fields of the last base come first."""

    auto_enable: bool = fixed(False, "", "enable once by itself when the device answers, unless a person stopped it")
    auto_enable_wait: float = fixed(0.0, "s", "longest that auto_enable waits for a tool's first answer", 0.0, 600.0)
    publish: DriverTopics


class DeviceTopics(Group):
    """What a simulated device publishes."""

    rate: float = fixed(500.0, "Hz", "operator/state", 1.0, 1000.0)


class Loopback(Operator, Common):
    """haptic_loopback."""

    motor_watchdog: float = fixed(0.015, "s", "time without a write after which the motor is cut", 0.001, 10.0)
    publish: DeviceTopics


class Bridge(Common):
    """haptic_bridge."""

    port: str = fixed("", "", "serial port, or UDP port or HOST:PORT, in place of that of the device description")
    motor_watchdog: float = fixed(0.015, "s", "time without a write after which the motor is taken back", 0.001, 10.0)
    publish: DeviceTopics


class Split(Group):
    """When a bag begins a new file."""

    size: float = fixed(2000.0, "MB", "size from which on a new file is begun; 0: never", 0.0, 1e6)
    duration: float = fixed(0.0, "s", "time after which a new file is begun; 0: never", 0.0, 1e6)


class Trial(Group):
    """Facts of an experiment."""

    participant: str = live("", "", "code of the participant, kept in the next bag")
    condition: str = live("", "", "experimental condition, kept in the next bag")
    fields: tuple[str, ...] = live(("",), "", "further facts of the trial, each as name=value")


class Recorder(Group):
    """haptic_recorder."""

    autostart: bool = fixed(True, "", "configure and activate by itself at start")
    realtime: Realtime = fixed("prefer", "", "SCHED_FIFO, so that no load starves it, and one core")
    bag: str = fixed("", "", "folder of the bag, new or empty; if no name is given, haptic_bags/<date>-<time>")
    queue: int = fixed(2000, "messages", "what each topic may hold between two looks", 1, 100000)
    look_period: float = fixed(0.04, "s", "time between two looks at the queues", 0.001, 0.5)
    flush_period: float = fixed(0.25, "s", "time between chunks written out: what a kill can lose", 0.02, 0.75)
    split: Split
    disk_reserve: float = fixed(200.0, "MB", "with less than this free, recording stops and ends its bag", 0.0, 1e6)
    trial: Trial


DRIVER_FIGURES = (
    Watched("margin", "N s/m", "physical damping left in the worst direction, at the measured lateness", 0.0, -1.0),
    Watched("margin_theta", "N m s/rad", "the same about theta, of a device that turns", 0.0, -0.001),
    Watched("lateness", "s", "wake-up of the servo after its deadline, 99 %", 1e-4, 1e-3),
    Watched("compute", "s", "own work of a tick, 99 %", 5e-5, 1e-4),
    Watched("missed", "1/s", "ticks missed", 1.0, 100.0),
    Watched("age", "s", "age of the tool sample in use, 99 %", 0.01, 0.06),
    Watched("loss", "", "share of the handle samples that were not answered", 0.1, 0.5),
    Watched("energy", "J", "energy given to the operator, as the servo books it", 0.01, 0.1),
    Watched("thermal_load", "", "greatest thermal load of a motor; at its limit for ever: 1", 0.6, 0.9),
    Watched("stall", "s", "longest time python, which hears services, stood still", 0.2, 1.0),
    Watched("skipped", "", "share of the samples of encoder, motor, wrench and pose that were left out", 0.1, 0.9),
    Watched("dropped", "", "share of the trace's rows that were left out", 0.0, 0.5),
)
LOOPBACK_FIGURES = (
    Watched("energy", "J", "energy given to the operator, in truth", 0.01, 0.1),
    Watched("run_on", "1/s", "deadlines that passed without a write of the servo", 1.0, 100.0),
    Watched("late_writes", "1/s", "writes whose time had been integrated over", 1.0, 100.0),
)

BRIDGE_FIGURES = (
    Watched("delay", "s", "from the servo's write to the motor's effect, 99 %", 1e-3, 5e-3),
    Watched("clock_error", "s", "what is not known of the device's clock", 1e-4, 1e-3),
    Watched("lost", "1/s", "deadlines whose samples never came", 1.0, 100.0),
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
