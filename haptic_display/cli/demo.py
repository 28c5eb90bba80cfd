# SPDX-License-Identifier: Apache-2.0
"""`haptic demo`: the whole system as processes, a scripted operator at the handle, a bag, a table and a picture."""

import contextlib
import json as json_text
import os
import time
from functools import partial
from pathlib import Path
from typing import Annotated

import psutil
import typer

from haptic_device.config.files import find, names
from haptic_device.config.parameter_files import read_operating_point
from haptic_device.os_errors import in_words
from haptic_device.process import say
from haptic_display.cli.completion import exchange_method, shipped
from haptic_display.cli.keys import ESTOP, keys, stop_key
from haptic_display.cli.numbers import number, whole
from haptic_display.cli.progress import INTERRUPTED, status_line
from haptic_display.cli.words import next_step, shown_path
from haptic_display.run.domain import isolated_domain
from haptic_display.run.prepare import prepare, promise, value_of
from haptic_display.run.processes import NAMESPACE, NodeDiedError, Nodes, Program, interruptible, undisturbed
from haptic_display.run.system import Order, Relay, is_served_by_others, led_by_hand, programs_of
from haptic_sim.node.parameters import HOME_PORT, NODES

_EXCHANGE = "Exchange method between driver and simulation."
_PARAMS = "Operating point: a name in config or a YAML file [that of the --device's name, or demo]."
_DELAY = "Round trip added between driver and simulation by a relay [ms]."
_SCENE = "A name in config/scenes or a YAML file [that of --params, or peg_in_hole]."
_DEVICE = "Device description, in place of that of --params: a name in config/devices or a YAML file."
_JITTER = "Uniform ± of that round trip [ms]."
_LOSS = "Share of the messages lost, either way."
_SECONDS = "Length from the first motor command on; without it the run ends with the operator's motion."


def demo(
    scene: Annotated[str | None, typer.Option(help=_SCENE, autocompletion=shipped("scenes"))] = None,
    seconds: Annotated[float | None, number("s", 0.5, 3600.0, help=_SECONDS)] = None,
    out: Annotated[Path | None, typer.Option(help="New folder of the run [haptic_runs/SCENE-TIME].")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on standard output, no table.")] = False,
    everything: Annotated[bool, typer.Option("--all", help="Print every figure, not only the main ones.")] = False,
    exchange: Annotated[str | None, typer.Option(help=_EXCHANGE, autocompletion=exchange_method)] = None,
    rate: Annotated[float | None, number("Hz", 500.0, 10000.0, help="Servo rate [Hz].")] = None,
    params: Annotated[str | None, typer.Option(help=_PARAMS, autocompletion=shipped(""))] = None,
    device: Annotated[str | None, typer.Option(help=_DEVICE, autocompletion=shipped("devices"))] = None,
    delay: Annotated[float, number("ms", 0.0, 2000.0, help=_DELAY)] = 0.0,
    jitter: Annotated[float, number("ms", 0.0, 2000.0, help=_JITTER)] = 0.0,
    loss: Annotated[float, number("", 0.0, 1.0, help=_LOSS)] = 0.0,
    view: Annotated[bool, typer.Option("--view", help="Open a web page on which the mouse is the hand.")] = False,
    host: Annotated[str, typer.Option(help="Address of that page; beyond this machine it warns.")] = "127.0.0.1",
    port: Annotated[int, whole(0, 65535, help="Its TCP port; 0: any that is free.")] = HOME_PORT,
) -> None:
    """Run device, driver, simulation and recorder on a scene. Exit code 0 only if the job was done."""
    started, order = time.monotonic() - (time.time() - psutil.Process().create_time()), None
    try:
        with interruptible():
            order = _order(scene, seconds, out, exchange, rate, params, device)
            relay = Relay(delay * 1e-3, jitter * 1e-3, loss)
            order = order._replace(relay=relay if any(relay) else None)
            done = _view(order, host, port) if view else run(order, started, json, everything)
    except KeyboardInterrupt:
        say(f"haptic demo: interrupted; all nodes have ended{_kept(order)}")
        os._exit(INTERRUPTED)  # an interrupt that struck inside exec() would otherwise end python by SIGINT
    raise typer.Exit(0 if done else 1)


def _kept(order: Order | None) -> str:
    """Where the recording of a run is that was interrupted; "" before there is any."""
    bag = order and order.out / "bag"
    return f"; the recording is {bag}" if bag and bag.exists() else ""


def _view(order, host, port):
    from haptic_display.page.node_manager import play

    with stop_key() as stop:
        done = play(order, {"host": host, "port": port}, stop)
    say(f"haptic demo: all nodes have ended{_kept(order)}")
    if (order.out / "bag").exists():
        next_step(f"haptic report {shown_path(order.out / 'bag')}")
    return done


def run(order: Order, started: float, as_json: bool, everything: bool = False) -> bool:
    """Runs the order, reports, and says whether the job was done."""
    programs, unended, found, wrong = programs_of(order), "", {}, []
    try:
        unended = _play(order, programs)
        found = _evaluate(order, started)
    except (NodeDiedError, ValueError, OSError) as error:
        wrong.append(in_words(error))
    return _conclude(order, found, unended, wrong, as_json, everything)


def _order(scene, seconds, out, exchange, rate, params, device) -> Order:
    point = find("", params or _own_point(device)).absolute()
    scene = scene or read_operating_point(point, NODES)["haptic_simulation"].get("scene", "peg_in_hole")
    out = out or Path("haptic_runs") / f"{Path(scene).stem}-{time.strftime('%Y%m%d-%H%M%S')}"
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"--out {out} exists already and is not empty; name a new folder")
    return Order(scene, seconds, out.absolute(), exchange, rate, point, device=device)


def _own_point(device: str | None) -> str:
    """The operating point that is named as the device, with the gains for it; else demo."""
    name = Path(device or "").stem
    return name if name in names("") else "demo"


def play(order: Order) -> bool:
    """Starts the nodes of the order, follows them to the end of the run, stops them. True if the run ended as asked;
    else it is said why. Raises NodeDiedError, ValueError if no motor command came and no fault, OSError."""
    if unended := _play(order, programs_of(order)):
        say(f"haptic demo: {unended}")
    return not unended


def _play(order: Order, programs: list[Program]) -> str:
    """Why the run did not end as asked, or ""."""
    if order.seconds is None and not led_by_hand(programs):
        raise ValueError("no hand is simulated at this device, whose motion would end the run; write --seconds")
    if is_served_by_others(programs) and not os.environ.get("ROS_DOMAIN_ID"):
        raise ValueError("a program of your own serves this device: export ROS_DOMAIN_ID=N where it runs, and here")
    prepare(programs)
    if unkept := promise(programs):
        say(f"haptic demo: {unkept}")
    ending = _run_or_begin_anew(order, programs)
    if not (ending.commanded or ending.fault):
        raise ValueError(ending.why)
    return ending.why


def _run_or_begin_anew(order: Order, programs: list[Program]):
    """How the run ended. Where the device fell silent before the motion had begun, as on a machine that does much else,
    this is said, and all is done once more."""
    ending = _once(order, programs)
    if not _stalled(ending):
        return ending
    from haptic_display.fault_sentence import fell  # it loads the compiler, as what follows the run has done

    kept, fault = _set_aside(order.out), fell(ending.fault)
    say(f"haptic demo: {fault}; all nodes are started anew, and {kept} keeps this start")
    ending = _once(order, programs)
    return ending._replace(why=f"{fault} again: {_too_busy(programs)}") if _stalled(ending) else ending


def _once(order: Order, programs: list[Program]):
    with isolated_domain(order.out / "log") as domain, Nodes(order.out / "log") as nodes:
        for program in programs:
            nodes.start(program)
        say(f"haptic demo: haptic status --domain {domain} shows more; space is the e-stop")
        if is_served_by_others(programs):
            from haptic_device.realtime.shared_memory import FOLDER, file_name  # it loads the compiler

            page = FOLDER / file_name(domain, NAMESPACE)
            say(f"haptic demo: the device's own program has to serve {page}, before or after this")
        return _follow(order.seconds, domain, nodes)


def _stalled(ending) -> bool:
    return ending.fault == "device_silent" and not ending.begun


def _too_busy(programs: list[Program]) -> str:
    [driver] = [program for program in programs if program.name == "haptic_driver"]
    silence = f"fault.silence = {value_of(driver, 'fault.silence'):g} s"
    todo = "end what else keeps the machine busy, take a lower --rate, or write a longer fault.silence into --params"
    return f"the machine was too busy to serve the device for {silence}; {todo}"


def _set_aside(out: Path) -> Path:
    """Moves what a start left out of the next one's way."""
    kept = out / "first_start"
    kept.mkdir()
    for name in ("bag", "log"):
        if (out / name).exists():
            (out / name).rename(kept / name)
    return kept


def _follow(seconds, domain, nodes):
    with undisturbed():  # some imports would lose a KeyboardInterrupt
        from haptic_display.client import Client  # ROS is imported while the nodes start
        from haptic_display.run.follow import follow
        from haptic_display.service_requests import trigger

    estop = trigger("haptic_driver/estop")
    with contextlib.closing(Client.join("haptic_demo", domain, NAMESPACE)) as client, keys() as pressed:
        client.prepare(estop.service)

        def check():
            printed = nodes.check()
            if pressed() == ESTOP:
                try:
                    said = client.call(estop)
                except ValueError as refusal:
                    said = refusal
                say(f"e-stop: {said}")
            return printed

        def tell(sentence):
            say(f"haptic demo: {sentence}")

        with status_line() as show:
            return follow(seconds, client, check, show, tell)


def _evaluate(order: Order, started: float) -> dict:
    from haptic_device.recording import load
    from haptic_display.run.outcome import done_at, figures
    from haptic_display.run.report.picture import draw_picture
    from haptic_display.run.report.run import Run
    from haptic_sim.scene.draw import draw
    from haptic_sim.scene.language import load as load_scene

    recording = load(order.out / "bag")
    missing = recording.trace_rows_missing
    for note in (*recording.notes, *([f"{missing} ticks are missing from the trace"] if missing else [])):
        say(f"haptic demo: {note}")
    report = order.out / "report.png"
    lossy = order.relay is not None and (order.relay.loss > 0.0 or order.relay.jitter > 0.0)
    found = figures(recording, started, lossy)
    run, scene = Run(recording, order.scene), load_scene(order.scene)
    draw_picture(run, report, partial(draw, scene), done_at(run, scene.task))
    return found | {"report": str(report)}


def _conclude(order: Order, found: dict, unended: str, wrong: list[str], as_json: bool, everything: bool) -> bool:
    from haptic_display.cli.tables import print_outcome
    from haptic_display.run.outcome import ANSWERED, not_done, nothing, task_of
    from haptic_sim.scene.language import load

    bag = order.out / "bag"
    found = nothing() | found
    found["faults"], found["task"] = found["faults"] + wrong, task_of(load(order.scene).task, found)
    why = not_done(found, unended, 0.0 if order.relay else ANSWERED)
    said = [why or unended, (found["exchange"] or {}).get("cause"), found["late"]]
    if found["exchange"] and not as_json:  # what stands below the table is said there
        said = [] if why else [unended]
    for sentence in filter(None, said):
        say(f"haptic demo: {sentence}")
    found = {"scene": order.scene, "done": not why, "why": why, **found, "bag": str(bag) if bag.exists() else None}
    if as_json:
        print(json_text.dumps(found))
        return not why
    print_outcome(found, everything)
    shows = found["bag"] and found["exchange"]
    next_step(f"haptic report {shown_path(found['bag'])}" if shows else f"read {shown_path(order.out / 'log')}")
    return not why
