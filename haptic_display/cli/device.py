# SPDX-License-Identifier: Apache-2.0
"""`haptic device find`, `show`, `kinematics`, `set-up`, `test`: a device of one's own, from plug to promises."""

import contextlib
import json
import os
import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.process import say
from haptic_display.cli.completion import shipped
from haptic_display.cli.numbers import number, whole
from haptic_display.cli.words import console, next_step, refused, shown_path, table

device = typer.Typer(no_args_is_help=True, help="A device of your own: find it, look at it, describe it, test it.")
PAUSE = 0.2  # [s] between two looks
SETTLES = 1.0  # [s] that the system takes to set a new port's permissions
LISTENING = 2.0  # [s]

_NAME = "Device description (a name in config/devices or a file)."
_BEGIN = "Description to begin with, which has the link and the limits."
_DOMAIN = "ROS domain in which haptic_bridge or haptic_loopback runs, and no driver; else it is started here."
_NAMESPACE = "Namespace of the device that runs."
_JSON = "Print one JSON object instead of a table."
_WATCH = "Wait for a device that is plugged in; tell which it is."
_MOTOR = "Motor value that x, or the first joint, is given meanwhile (motor units)."
_JOINTS = "Angles A,B of the joints (degrees); of one joint A."
_POSITION = "Place X,Y of the handle in the linkage's frame (m); of one joint X."


@device.command()
def find(
    udp: Annotated[list[str] | None, typer.Option(help="HOST:PORT of UDP to be asked too; may be repeated.")] = None,
    baud: Annotated[int, whole(1200, 4_000_000, help="Speed of a serial line; USB CDC has none.")] = 115200,
    wait: Annotated[float, number("s", 0.1, 60.0, help="Time to answer, of each port (s).")] = 1.0,
    silent: Annotated[bool, typer.Option("--silent", help="Send nothing to any port.")] = False,
    watch: Annotated[bool, typer.Option("--watch", help=_WATCH)] = False,
    as_json: Annotated[bool, typer.Option("--json", help=_JSON)] = False,
) -> None:
    """Which devices are connected, what answers, and why nothing does. Exit code 1: nothing answered."""
    from haptic_device.jit import ensure_compiled
    from haptic_display.device_tools import search as device_search
    from haptic_display.device_tools import serial_ports

    with refused("device find"):
        for address in udp or ():
            device_search.address_of(address)
        if watch and udp:
            raise ValueError("--watch is for what is plugged in: leave --udp out")
        ensure_compiled("bridge")  # whose coding of frames is used: else the time to answer would pass meanwhile
        if watch:
            typer.echo("unplug the device and plug it in again; Ctrl-C ends", err=True)
            port = device_search.plugged(serial_ports.ports, say, lambda: time.sleep(PAUSE))
            time.sleep(SETTLES)
            again = next((one for one in serial_ports.ports() if one.path == port.path), port)
            found = [device_search.found_at(again, serial_ports.grabber(), baud, wait, not silent)]
        else:
            found = device_search.look(baud=baud, patience=wait, hello=not silent)
            found += [device_search.look_at(address, wait) for address in udp or ()]
    if as_json:
        typer.echo(json.dumps({"found": found}))
    else:
        _print_found(found)
        if any(one["link"] for one in found):
            next_step("write this link into a description, then haptic device set-up DESCRIPTION")
    raise typer.Exit(0 if any(one["greeting"] for one in found) else 1)


def _print_found(found):
    from haptic_device.config.yaml_reader import dump

    if not found:
        typer.echo("no serial port of a USB device is there; a device on UDP needs --udp")
    for one in found:
        usb = one.get("usb", {})
        said = " ".join(filter(None, (usb.get("maker"), usb.get("model"), usb.get("serial"))))
        where = one.get("by_id") or one.get("port") or one["address"]
        typer.echo(f"{where}{f'  ({said})' if said else ''}\n    {one['answer']}")
        if one["link"]:
            typer.echo(f"    {dump({'link': one['link']}, flow=True).strip()}")
        for note in one["notes"]:
            typer.echo(f"    {note}")


@device.command(short_help="How the connected device is, live.")
def show(
    domain: Annotated[int | None, whole(0, 232, help="ROS domain [ROS_DOMAIN_ID, or 0].")] = None,
    namespace: Annotated[str | None, typer.Option(help="Namespace of the display [/haptic].")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Listen for 2 s, print one JSON object, end.")] = False,
) -> None:
    """How the connected device is, live: counts, status, delay, clock, losses. Exit code 1: none answers."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    from haptic_device import ros_environment
    from haptic_display.device_tools.watch import DeviceWatch

    with refused("device show"):
        domain = ros_environment.domain() if domain is None else domain
        with contextlib.closing(DeviceWatch(domain, namespace)) as watched:
            if as_json or not (sys.stdin.isatty() and sys.stdout.isatty()):
                end = time.monotonic() + LISTENING
                while time.monotonic() < end:
                    watched.look()
                    time.sleep(0.02)
                figures, there = watched.figures(), watched.answering()
                typer.echo(json.dumps(figures)) if as_json else console().print(_figures(figures, domain))
            else:
                there = _live(watched, domain)
    if not there and not as_json:
        next_step("haptic device find")
    raise typer.Exit(0 if there else 1)


def _live(watched, domain):
    from rich.console import Group
    from rich.live import Live

    from haptic_display.cli.keys import keys

    with contextlib.suppress(KeyboardInterrupt), keys() as pressed, Live(auto_refresh=False) as display:
        while pressed() != "q":
            watched.look()
            display.update(Group(_figures(watched.figures(), domain), "q: quit"), refresh=True)
            time.sleep(0.05)
    return watched.answering()


def _figures(figures, domain):
    rows = ((name, *told) for name, told in figures.items())
    caption = None if figures else "nothing heard yet"
    return table(("figure", "", "unit"), rows, title=f"device in ROS domain {domain}", caption=caption)


@device.command(short_help="Where a linkage's handle is, and its Jacobian.")
def kinematics(
    name: Annotated[str, typer.Argument(help=_NAME, autocompletion=shipped("devices"))],
    joints: Annotated[str | None, typer.Option(help=_JOINTS, metavar="A,B")] = None,
    position: Annotated[str | None, typer.Option(help=_POSITION, metavar="X,Y")] = None,
    as_json: Annotated[bool, typer.Option("--json", help=_JSON)] = False,
) -> None:
    """Where the handle of a linkage is at these joint angles, or the angles at this place, and the Jacobian."""
    from haptic_device.config.description import load_device
    from haptic_device.theory.felt import felt_at

    with refused("device kinematics"):
        described = load_device(name)
        if not described.joints:
            raise ValueError(f"{described.name} has no joints: each of its motors moves an axis")
        if (joints is None) == (position is None):
            raise ValueError("give --joints or --position, and not both")
        pose = felt_at(described, joints, position)
    linkage, jacobian, degrees = described.kinematics, pose.jacobian.tolist(), pose.values["joints"]
    if as_json:
        typer.echo(json.dumps({"position": pose.position, "jacobian": jacobian, "joints": degrees}))
        return
    names = [joint.name for joint in described.joints]
    rows = [(name, f"{angle:.6g}", "°") for name, angle in zip(names, degrees, strict=True)]
    for axis, at, zero, along in zip("xy", pose.position, linkage.origin, jacobian, strict=False):
        rows += [(axis, f"{at:.6g}", "m"), (f"{axis} from origin", f"{at - zero:.6g}", "m")]
        rows += [(f"∂{axis}/∂{name}", f"{each:.6g}", "m/rad") for name, each in zip(names, along, strict=True)]
    rows.append(("from singular (0: at it, 1: far)", f"{pose.singular:.4g}", ""))
    console().print(table(("figure", "", "unit"), rows, title=f"{described.name}, a {linkage.type}"))


@device.command("set-up", short_help="Describe a device by moving its handle.")
def set_up(
    name: Annotated[str, typer.Argument(help=_BEGIN, autocompletion=shipped("devices"))],
    out: Annotated[Path, typer.Option(help="Device description to write.")] = Path("device.yaml"),
    answers: Annotated[Path | None, typer.Option(help="YAML file of answers; nobody is asked then.")] = None,
    push: Annotated[float, number("motor units", 0.001, 1.0, help="Most that a motor is given (motor units).")] = 0.01,
    domain: Annotated[int | None, whole(0, 232, help=_DOMAIN)] = None,
    namespace: Annotated[str | None, typer.Option(help=_NAMESPACE)] = None,
) -> None:
    """Describe a device by moving its handle: signs, counts per unit, zero, workspace, motor signs."""
    from haptic_device.config.description import load_device
    from haptic_display.device_tools import device_page
    from haptic_display.device_tools import set_up as device_set_up
    from haptic_display.device_tools.questions import Answers, Terminal

    with refused("device set-up"):
        if answers is None and not (sys.stdin.isatty() and sys.stdout.isatty()):
            raise ValueError(
                "it asks for what only a hand at the device can tell: run it in a terminal, or give --answers"
            )
        _refuse_file(out)
        questions = Answers.read(answers) if answers else Terminal()
        described = load_device(name)
        device_set_up.refuse_linkage(described)
        with device_page.opened(name, domain, namespace) as page:
            content = device_set_up.set_up(questions, device_page.PageDevice(page), described, out.stem, push)
        device_set_up.write(out, content, described.name)
        typer.echo(f"wrote {out}; haptic check {out} reads it again")
        if domain is None and namespace is None and questions.yes("identify", IDENTIFY):
            _identify(out)
        next_step(f"haptic device test {shown_path(out)}")


IDENTIFY = "Mass, damping and friction are not measured yet. Shake the handle for 8 s now, with nobody holding it?"


def _identify(out):
    from haptic_device.config.description import load_device
    from haptic_device.jit import ensure_compiled
    from haptic_display.device_tools.identification import identify_device, write_description
    from haptic_display.run.prepare import COMMANDS

    ensure_compiled(*COMMANDS["identify"])
    device = load_device(out)
    force = min(3.0, *(0.2 * axis.motor_limit for axis in device.axes[:2]))
    rate = 4000.0 if device.link.type == "loopback" else 1000.0  # Hz
    found, described = identify_device(str(out), None, 8.0, force, None, rate, None, None)
    write_description(out, described, found)
    typer.echo(f"wrote what was identified to {out}")


def _refuse_file(out):
    if not out.parent.is_dir() or out.exists():
        raise ValueError(f"--out is {out}, but it must be a new file in a folder that exists")


@device.command()
def test(
    name: Annotated[str, typer.Argument(help=_NAME, autocompletion=shipped("devices"))] = "desktop",
    motor: Annotated[float, number("motor units", 0.0, 1.0, help=_MOTOR)] = 0.01,
    domain: Annotated[int | None, whole(0, 232, help=_DOMAIN)] = None,
    namespace: Annotated[str | None, typer.Option(help=_NAMESPACE)] = None,
    as_json: Annotated[bool, typer.Option("--json", help=_JSON)] = False,
) -> None:
    """Try every promise that a device owes the servo. Exit code 1: one is not kept, 2: nothing could be tried."""
    from haptic_device.config.description import load_device
    from haptic_display.device_tools import conformance, device_page

    with refused("device test"), device_page.opened(name, domain, namespace) as page:
        first = next((joint.name for joint in load_device(name).joints), "x")
        typer.echo(f"the motor of {first} is given {motor:g} motor units for some seconds: leave the handle", err=True)
        results = conformance.check_all(page, lambda told: say(f"trying: {told}"), motor)
    if as_json:
        typer.echo(json.dumps({"checks": [result._asdict() for result in results]}))
    else:
        verdicts = {True: ("kept", "green"), False: ("NOT kept", "bold red")}
        rows = ((one.name, verdicts[bool(one.passed)], one.figure or one.sentence) for one in results)
        console().print(table(("promise", "", "measured, or why not"), rows))
    kept = all(result.passed for result in results)
    if kept and not as_json:
        next_step(f"haptic demo --scene wall --seconds 20 --device {shown_path(name)}")
    raise typer.Exit(0 if kept else 1)
