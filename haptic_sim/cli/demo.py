# SPDX-License-Identifier: Apache-2.0
"""`haptic demo`: the whole system as processes, a scripted operator at the handle, a bag, a table and a picture."""

import json as json_text
import os
import sys
import time
from pathlib import Path
from typing import Annotated, NamedTuple

import psutil
import typer

from haptic_sim.cli import viewing
from haptic_sim.cli.domain import isolated_domain
from haptic_sim.cli.processes import NodeDiedError, Nodes, Program, interruptible

INTERRUPTED = 130
TOGETHER = 45.0  # [s] that the display waits for its simulation, which may be compiling its kernels
FAR = {name: f"far_{name}" for name in ("handle", "tool", "local_contacts")}  # topics of a simulation behind a relay
_DELAY = "Round trip added between driver and simulation by a relay [ms]."
_SECONDS = "Length from the first motor command on; without it the run ends with the operator's motion."


class Relay(NamedTuple):
    """A bad network between driver and simulation: delay and jitter of the round trip [s], share lost either way."""

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0


class Order(NamedTuple):
    """What is to be run; `given` goes before what scene and operating point say: {node: {parameter: value}}."""

    scene: str
    seconds: float | None
    out: Path
    exchange: str | None
    rate: float | None
    params: Path
    relay: Relay | None = None
    given: dict[str, dict] = {}


def demo(
    scene: Annotated[str, typer.Option(help="A name in config/scenes or a YAML file.")] = "peg_in_hole",
    seconds: Annotated[float | None, typer.Option(min=0.5, max=3600.0, help=_SECONDS)] = None,
    out: Annotated[Path | None, typer.Option(help="New folder of the run [haptic_runs/SCENE-TIME].")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output, no table.")] = False,
    exchange: Annotated[str | None, typer.Option(help="Exchange method between driver and simulation.")] = None,
    rate: Annotated[float | None, typer.Option(help="Servo rate [Hz].")] = None,
    params: Annotated[str, typer.Option(help="Operating point: a name in config or a YAML file.")] = "demo",
    delay: Annotated[float, typer.Option(min=0.0, max=2000.0, help=_DELAY)] = 0.0,
    jitter: Annotated[float, typer.Option(min=0.0, max=2000.0, help="Uniform ± of that round trip [ms].")] = 0.0,
    loss: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of the messages lost, either way.")] = 0.0,
    view: Annotated[bool, typer.Option("--view", help="Open a web page on which the mouse is the hand.")] = False,
    host: Annotated[str, typer.Option(help="Address of that page; beyond this machine it warns.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Its TCP port; 0: any that is free.")] = 0,
) -> None:
    """Run loopback device, driver, simulation and recorder on a scene. Exit code 0 only if the job was done."""
    started = time.monotonic() - (time.time() - psutil.Process().create_time())
    try:
        with interruptible():
            order = _order(scene, seconds, out, exchange, rate, params)
            relay = Relay(delay * 1e-3, jitter * 1e-3, loss)
            order = order._replace(relay=relay if any(relay) else None)
            page = {"host": host, "port": port}
            done = viewing.play(order, programs_of, Relay, page) if view else run(order, started, json)
    except KeyboardInterrupt:
        print("haptic demo: interrupted; all nodes have ended", file=sys.stderr, flush=True)
        os._exit(INTERRUPTED)  # an interrupt that struck inside exec() would otherwise end python by SIGINT
    raise typer.Exit(0 if done else 1)


def run(order: Order, started: float, as_json: bool) -> bool:
    """Runs the order, reports, and says whether the job was done."""
    programs, ended, found, wrong = programs_of(order), False, {}, []
    try:
        ended = _play(order, programs)
        found = _evaluate(order, started)
    except (NodeDiedError, ValueError, OSError) as error:
        print(f"haptic demo: {error}", file=sys.stderr)
        wrong.append(str(error))
    return _conclude(order, found, ended, wrong, as_json)


def _order(scene, seconds, out, exchange, rate, params) -> Order:
    from haptic_device.config_files import find

    out = out or Path("haptic_runs") / f"{Path(scene).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"--out {out} exists already and is not empty; name a new folder")
    return Order(scene, seconds, out.absolute(), exchange, rate, find("", params).absolute())


def programs_of(order: Order) -> list[Program]:
    """The four nodes in the order of their start; they are stopped in the reverse order, the recorder last."""
    from haptic_device.config_files import find
    from haptic_device.parameter_files import read_operating_point
    from haptic_sim.cli.nodes import NODES
    from haptic_sim.scene import load

    read_operating_point(order.params, NODES)
    scene = find("scenes", order.scene).absolute()
    motion = {f"motion.{key}": value for key, value in load(scene).motion.items()}
    driver = {"servo.rate": order.rate, "exchange.method": order.exchange}
    driver |= {"auto_enable": True, "auto_enable_wait": TOGETHER}
    given = {
        "haptic_recorder": {"bag": str(order.out / "bag")},
        "haptic_loopback": motion,
        "haptic_simulation": {"scene": str(scene), "exchange.method": order.exchange},
        **({"haptic_relay": order.relay._asdict()} if order.relay else {}),
        "haptic_driver": driver,
    }
    given = {name: _stated(values) | order.given.get(name, {}) for name, values in given.items()}
    programs = [_program(name, values, NODES[name], order.params) for name, values in given.items()]
    far = FAR if order.relay else {}
    return [program._replace(renamed=far if program.name == "haptic_simulation" else {}) for program in programs]


def _stated(values: dict) -> dict:
    return {name: value for name, value in values.items() if value is not None}


_MODULES = {
    "haptic_recorder": "haptic_device.nodes.recorder",
    "haptic_loopback": "haptic_device.nodes.loopback",
    "haptic_simulation": "haptic_sim.node.simulation",
    "haptic_driver": "haptic_device.nodes.driver",
    "haptic_relay": "haptic_sim.node.network_emulator",
}


def _program(name: str, values: dict, declared: tuple, operating_point: Path) -> Program:
    """Checks the values against the node's declarations before any node starts. Raises ValueError, one sentence."""
    from haptic_device.parameter_types import check_value, unknown

    known = {parameter.name: parameter for parameter in declared}
    for key, value in values.items():
        if key not in known:
            raise ValueError(unknown(key, f"a parameter of {name}", known))
        check_value(known[key], value)
    return Program(name, _MODULES[name], values, (operating_point,))


def play(order: Order) -> bool:
    """Starts the nodes of the order, follows them to the end of the run, stops them. True if the run ended as asked."""
    return _play(order, programs_of(order))


def _play(order: Order, programs: list[Program]) -> bool:
    from haptic_sim.cli.prepare import prepare

    prepare(programs)
    with isolated_domain(order.out / "log") as domain, Nodes(order.out / "log") as nodes:
        for program in programs:
            nodes.start(program)
        print(f"haptic demo: haptic status --domain {domain} shows more; space is the e-stop", file=sys.stderr)
        from haptic_sim.cli.follow import follow  # ROS is imported while the nodes start

        return follow(order.seconds, domain, nodes.check)


def _evaluate(order: Order, started: float) -> dict:
    from haptic_device.analysis.bag_topics import load
    from haptic_device.analysis.report.page import draw_picture
    from haptic_device.analysis.report.run import Run
    from haptic_sim.cli.outcome import figures

    recording = load(order.out / "bag")
    missing = recording.trace_rows_missing
    for note in (*recording.notes, *([f"{missing} ticks are missing from the trace"] if missing else [])):
        print(f"haptic demo: {note}", file=sys.stderr)
    report = order.out / "report.png"
    found = figures(recording, started)
    draw_picture(Run(recording, order.scene), report)
    return found | {"report": str(report)}


def _conclude(order: Order, found: dict, ended: bool, wrong: list[str], as_json: bool) -> bool:
    from haptic_sim.cli.outcome import ANSWERED, job_done, nothing, print_table

    bag = order.out / "bag"
    found = nothing() | found
    found["faults"] = found["faults"] + wrong
    done = job_done(found, ended, 0.0 if order.relay else ANSWERED)
    found = {"scene": order.scene, "done": done, **found, "bag": str(bag) if bag.exists() else None}
    print(json_text.dumps(found)) if as_json else print_table(found)
    return found["done"]
