# SPDX-License-Identifier: Apache-2.0
"""The whole display as programs to start: device, driver, simulation and recorder for a scene."""

from pathlib import Path
from typing import NamedTuple

from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_device.config.parameter_files import PLACES, read_operating_point
from haptic_device.config.parameter_types import check_value, defaults, unknown
from haptic_display.run.device_programs import MODULES, REFERENCE, device_programs
from haptic_display.run.processes import Program
from haptic_sim.node.parameters import NODES
from haptic_sim.scene.needs import LOOPBACK, TOGETHER, Needs, needs_of

FAR = {name: f"far_{name}" for name in ("handle", "tool", "local_contacts")}  # topics of a simulation behind a relay
_MODULES = {
    "haptic_recorder": "haptic_device.nodes.recorder",
    "haptic_simulation": "haptic_sim.node.simulation",
    "haptic_driver": "haptic_device.nodes.driver",
    "haptic_relay": "haptic_sim.node.network_emulator",
}


class Relay(NamedTuple):
    """A bad network between driver and simulation: delay and jitter of the round trip [s], share lost either way."""

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0


class Order(NamedTuple):
    """What is to be run; `given` goes before what scene and operating point say: {node: {parameter: value}}; device:
    the description of driver and device in place of theirs."""

    scene: str
    seconds: float | None
    out: Path
    exchange: str | None
    rate: float | None
    params: Path
    relay: Relay | None = None
    given: dict[str, dict] = {}
    device: str | None = None


def programs_of(order: Order) -> list[Program]:
    """Nodes and device in the order of their start; they are stopped in the reverse order, the recorder last."""
    from haptic_sim.scene.checks import hand_inside  # geometry, which a command that only parses does without
    from haptic_sim.scene.language import load

    said = read_operating_point(order.params, NODES)
    scene = find("scenes", order.scene).absolute()
    world = load(scene)
    driver = {"servo.rate": order.rate, "exchange.method": order.exchange}
    driver |= {"auto_enable": True, "auto_enable_wait": TOGETHER}
    given = {
        "haptic_recorder": {"bag": str(order.out / "bag")},
        LOOPBACK: {},
        "haptic_simulation": {"scene": str(scene), "exchange.method": order.exchange},
        **({"haptic_relay": order.relay._asdict()} if order.relay else {}),
        "haptic_driver": driver,
    }
    # ROS would take a path in the file as relative to where we are
    files = {name: {key: said[name][key] for key in PLACES if key in said[name]} for name in given}
    stated = {name: {key: each for key, each in some.items() if each is not None} for name, some in given.items()}
    given = {name: files[name] | values | order.given.get(name, {}) for name, values in stated.items()}
    if order.device:
        given["haptic_driver"]["device"] = given[LOOPBACK]["device"] = str(find("devices", order.device).absolute())
    _refuse_bad_devices(given, order.params)
    simulated = given[LOOPBACK].get("device") or given["haptic_driver"].get("device", "")  # that of the driver, if none
    needs = needs_of(scene, simulated)
    device = {"device": needs.device} if needs.device else {}
    given[LOOPBACK] = ({} if _moved_by_file(said, scene) else needs.motion) | given[LOOPBACK] | device
    programs = []
    for name, values in given.items():
        program = _program(name, values, NODES[name], order.params)
        programs += _device(program, said[LOOPBACK], order, needs) if name == LOOPBACK else [program]
    hand = defaults(NODES[LOOPBACK]) | said[LOOPBACK] | given[LOOPBACK]
    if led_by_hand(programs) and hand["motion.name"] != "follow":  # one that follows is led out by a person
        for inside in hand_inside(tuple(world.solids.values()), world.kept_apart, hand["motion.start"]):
            raise ValueError(f"{scene}: {inside}")
    far = FAR if order.relay else {}
    return [program._replace(renamed=far if program.name == "haptic_simulation" else {}) for program in programs]


def _device(loopback: Program, said: dict, order: Order, needs: Needs) -> list[Program]:
    """What the device of the driver needs, in place of the loopback: its hand is that which the loopback would have."""
    if needs.serving == LOOPBACK:
        return [loopback]
    hand = {key: value for key, value in (said | loopback.parameters).items() if key != "device"}
    return device_programs(needs.device, hand, order.out / "log", loopback.files)


def led_by_hand(programs: list[Program]) -> bool:
    """Whether a simulated hand is among the programs, whose motion ends a run."""
    return any(program.name in (LOOPBACK, REFERENCE) for program in programs)


def is_served_by_others(programs: list[Program]) -> bool:
    """Whether the device's page is served by none of the programs, but by one of the user's own."""
    return not any(program.name in MODULES for program in programs)


def _moved_by_file(said: dict[str, dict], scene: Path) -> bool:
    """Whether an operating point names this scene and a motion in it, which then goes before the scene's suggestion."""
    named = said["haptic_simulation"].get("scene")
    moves = any(name.startswith("motion.") for name in said["haptic_loopback"])
    return moves and named is not None and find("scenes", named).absolute() == scene


def _refuse_bad_devices(given: dict[str, dict], params: Path) -> None:
    """Before any node starts. Raises ValueError, one sentence: of which node, by which operating point, which file."""
    for node in ("haptic_driver", "haptic_loopback"):
        try:
            load_device(given[node].get("device", defaults(NODES[LOOPBACK])["device"]))
        except (ValueError, OSError) as error:
            raise ValueError(f"{params}: {node}: device {error}") from None


def _program(name: str, values: dict, declared: tuple, operating_point: Path) -> Program:
    """Checks the values against the node's declarations before any node starts. Raises ValueError, one sentence."""
    known = {parameter.name: parameter for parameter in declared}
    for key, value in values.items():
        if key not in known:
            raise ValueError(unknown(key, f"a parameter of {name}", known))
        check_value(known[key], value)
    return Program(name, (MODULES | _MODULES)[name], values, (operating_point,))
