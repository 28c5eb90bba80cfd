# SPDX-License-Identifier: Apache-2.0
"""`haptic identify`: shakes the connected device, and writes what it is made of as a device description."""

import json
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.digits import with_error
from haptic_display.cli.completion import shipped
from haptic_display.cli.numbers import number, whole
from haptic_display.cli.words import console, next_step, refused, shown_path, table

_DEVICE = "Device description that the driver has, the beginning of the search (a name in config/devices or a file)."
_FORCE = "Largest force of the shaking on each axis (N) [3, or of a linkage a fifth of what it makes]."
_TORQUE = "Largest torque of the shaking about theta (N m) [a twentieth of its motor's]."
_RATE = "Servo rate of a driver that is started here (Hz)."
_LOOPBACK = "Description of the loopback that is started, if it is to be another device."
_DOMAIN = "Identify the driver that runs in this ROS domain, with nobody holding the handle."


WORDS = {"coulomb": "Coulomb friction", "resolution": "encoder step", "residual": "position error, RMS"}
PREFIX = {"delay": ("m", 1e3), "resolution": ("µ", 1e6), "residual": ("µ", 1e6)}  # of the table


def identify(
    out: Annotated[Path, typer.Option(help="Device description to write.")] = Path("identified.yaml"),
    device: Annotated[str, typer.Option(help=_DEVICE, autocompletion=shipped("devices"))] = "desktop",
    loopback: Annotated[str | None, typer.Option(help=_LOOPBACK, autocompletion=shipped("devices"))] = None,
    seconds: Annotated[float, number("s", 3.0, 600.0, help="How long it is shaken (s).")] = 8.0,
    force: Annotated[float | None, number("N", help=_FORCE)] = None,
    torque: Annotated[float | None, number("N m", help=_TORQUE)] = None,
    rate: Annotated[float, number("Hz", 500.0, 10000.0, help=_RATE)] = 4000.0,
    domain: Annotated[int | None, whole(0, 232, help=_DOMAIN)] = None,
    namespace: Annotated[str | None, typer.Option(help="Namespace of the running driver.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
):
    """Mass, damping, friction, encoder step and delay of the connected device, with 95 % confidence."""
    from haptic_display.device_tools.identification import identify_device, write_description

    with refused("identify", "the gains are as they were"):
        _refuse_folder(out)
        found, described = identify_device(device, loopback, seconds, force, torque, rate, domain, namespace)
        write_description(out, described, found)
    report = {"device": described.name, "file": str(out), "axes": found}
    if as_json:
        typer.echo(json.dumps(report))
        return
    _show(report)
    next_step(f"haptic check {shown_path(out)}, then haptic demo --device {shown_path(out)}")


def _refuse_folder(out):
    if not out.parent.is_dir() or out.is_dir():
        raise ValueError(f"--out is {out}, but it must be a file in a folder that exists")


def _show(report):
    from rich.table import Column

    from haptic_display.device_tools.identification import STRAIGHT, UNITS

    axes = report["axes"]
    straight, turns = (any((name in STRAIGHT) is kind for name in axes) for kind in (True, False))
    rows = []
    for name, (unit, turning) in UNITS.items():
        prefix, scale = PREFIX.get(name, ("", 1.0))
        unit, turning = f"{prefix}{unit}", f"{prefix}{turning}"
        both = f"{unit}, theta {turning}" if straight and turning != unit else turning
        units = both if turns else unit
        values = (_scaled(*each[name], scale) for each in axes.values())
        rows.append((f"{WORDS.get(name, name)} [{units}]", *values))
    console().print(table(("", *(Column(axis, no_wrap=True) for axis in axes)), rows, title=report["device"]))
    print(f"description  {report['file']}")


def _scaled(value, error, scale):
    return with_error(value * scale, None if error is None else error * scale)
