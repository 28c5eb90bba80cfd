# SPDX-License-Identifier: Apache-2.0
"""`haptic identify`: shakes the connected device, and writes what it is made of as a device description."""

import json
from pathlib import Path
from typing import Annotated

import typer

from haptic_device.analysis.quantity import positive

INTERRUPTED = 130
SHARE = 0.05  # of the motor's torque, to turn with
_DEVICE = "Device description that the driver has, the beginning of the search (a name in config/devices or a file)."
_TORQUE = "Largest torque of the shaking about theta (N m) [a twentieth of its motor's]."
_LOOPBACK = "Description of the loopback that is started, if it is to be another device."
_COUPLING = ("coupling.stiffness", "coupling.damping", "coupling.rotational_stiffness", "coupling.rotational_damping")
_DOMAIN = "Identify the driver that runs in this ROS domain, with nobody holding the handle."


def identify(
    out: Annotated[Path, typer.Option(help="Device description to write.")] = Path("identified.yaml"),
    device: Annotated[str, typer.Option(help=_DEVICE)] = "desktop",
    loopback: Annotated[str | None, typer.Option(help=_LOOPBACK)] = None,
    seconds: Annotated[float, typer.Option(min=3.0, max=600.0, help="How long it is shaken (s).")] = 8.0,
    force: Annotated[float, typer.Option(help="Largest force of the shaking on each axis (N).")] = 3.0,
    torque: Annotated[float | None, typer.Option(help=_TORQUE)] = None,
    rate: Annotated[float, typer.Option(help="Servo rate of a driver that is started here (Hz).")] = 4000.0,
    domain: Annotated[int | None, typer.Option(min=0, max=232, help=_DOMAIN)] = None,
    namespace: Annotated[str | None, typer.Option(help="Namespace of the running driver.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
):
    """Mass, damping, friction, encoder step and delay of the connected device, with 95 % confidence."""
    from haptic_sim.cli.processes import NodeDiedError, interruptible

    try:
        _refuse_folder(out)
        with interruptible():
            found, described = _identify(device, loopback, seconds, force, torque, rate, domain, namespace)
        write(out, described, found)
    except (ValueError, OSError, NodeDiedError) as error:
        typer.echo(f"haptic identify: {error}", err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        typer.echo("haptic identify: interrupted; the gains are as they were", err=True)
        raise typer.Exit(INTERRUPTED) from None
    report = {"device": described.name, "file": str(out), "axes": found}
    typer.echo(json.dumps(report)) if as_json else _show(report)


def _identify(name, loopback, seconds, force, torque, rate, domain, namespace):
    from haptic_device.config_files import find
    from haptic_device.description import load_device
    from haptic_sim.cli.pair import running
    from haptic_sim.cli.shaking import record

    positive("force", force, "N")
    positive("rate", rate, "Hz")
    described = load_device(name)
    other = load_device(loopback) if loopback else described
    if len(other.axes) != len(described.axes):
        raise ValueError(f"--loopback has {len(other.axes)} axes and --device {len(described.axes)}")
    _refuse_force(described, force)
    torque = _torque(described, torque)
    told = {"device": str(Path(find("devices", name)).absolute()), "servo.rate": rate, **dict.fromkeys(_COUPLING, 0.0)}
    told |= {"fault.silence": 1.0, "fault.unattended": 0.0}  # nobody's hand is at this one
    true = {"device": str(Path(find("devices", loopback or name)).absolute()), **dict.fromkeys(_hand(), 0.0)}
    true["motor_watchdog"] = 1.0
    with running(domain, namespace, told, true) as (number, room, check):
        rows = record(number, room, check, described, seconds, force, torque)
    return {axis.name: estimate(rows, i, axis) for i, axis in enumerate(described.axes)}, described


def _refuse_folder(out):
    if not out.parent.is_dir() or out.is_dir():
        raise ValueError(f"--out is {out}, but it must be a file in a folder that exists")


def _hand():
    parts = ("mass", "damping", "stiffness", "rotational_mass", "rotational_damping", "rotational_stiffness")
    return tuple(f"hand.{part}" for part in parts)


def _refuse_force(device, force):
    for axis in device.axes[:2]:
        if force > axis.motor_limit:
            raise ValueError(
                f"force is {force:g} N, but the motor of axis {axis.name} gives at most {axis.motor_limit:g} N"
            )


def _torque(device, torque):
    """Largest torque of the shaking [N m]; None where nothing turns."""
    if len(device.axes) < 3:
        if torque is not None:
            raise ValueError(f"torque is {torque:g} N m, but {device.name} has no theta")
        return None
    limit = device.axes[2].motor_limit
    torque = SHARE * limit if torque is None else torque
    positive("torque", torque, "N m")
    if torque > limit:
        raise ValueError(f"torque is {torque:g} N m, but the motor of axis theta gives at most {limit:g} N m")
    return torque


def estimate(rows, index, axis):
    """Figures of one axis: name → (value, confidence or None)."""
    from haptic_device.analysis.identify import identify, resolution_of, trace_of

    per_count = axis.encoder_sign / axis.counts_per_unit
    found = identify(trace_of(rows, index, per_count), axis.mass, axis.damping)
    step = resolution_of(rows["counts"][:, index], per_count)
    values = {name: tuple(getattr(found, name)) for name in ("mass", "damping", "coulomb", "bias", "delay")}
    return values | {"resolution": (step, None), "residual": (found.residual, None)}


def write(path, described, found):
    """The description with what was found in it; the confidence stands beside it as comments."""
    import yaml

    delay = max(0.0, _weighted([axis["delay"] for axis in found.values()]))
    content = described.model_dump(mode="json")
    for axis in content["axes"]:
        for name in ("mass", "damping", "coulomb"):
            axis[name] = round(max(0.0, found[axis["name"]][name][0]), 9)
    content |= {"name": f"{described.name}_identified", "sensing_delay": 0.0, "actuation_delay": round(delay, 9)}
    lines = [f"#   {axis}: {_line(axis, values)}" for axis, values in found.items()]
    head = "# Identified by haptic identify, ± 95 % confidence. Only the sum of both delays can be told: it stands as\n"
    head += "# actuation_delay.\n"
    path.write_text(head + "\n".join(lines) + "\n" + yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def _weighted(estimates):
    """Mean of values, the surer the heavier."""
    weights = [1.0 / max(confidence, 1e-12) ** 2 for _, confidence in estimates]
    return sum(w * value for w, (value, _) in zip(weights, estimates, strict=True)) / sum(weights)


_UNITS = {
    "mass": ("kg", "kg m²"),
    "damping": ("N s/m", "N m s/rad"),
    "coulomb": ("N", "N m"),
    "bias": ("N", "N m"),
    "delay": ("s", "s"),
    "resolution": ("m", "rad"),
    "residual": ("m", "rad"),
}


def _line(axis, values):
    return ", ".join(f"{name} {_text(*pair)} {_UNITS[name][axis == 'theta']}" for name, pair in values.items())


def _text(value, confidence):
    return f"{value:.5g}" if confidence is None else f"{value:.5g} ± {confidence:.2g}"


def _show(report):
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    axes = report["axes"]
    table = Table("", *axes, title=report["device"])
    for name, (unit, turning) in _UNITS.items():
        label = f"{name} [{unit}, theta {turning}]" if "theta" in axes and turning != unit else f"{name} [{unit}]"
        table.add_row(escape(label), *(_text(*values[name]) for values in axes.values()))
    console = Console(width=None if Console().is_terminal else 140)
    console.print(table)
    console.print(f"description  {report['file']}", soft_wrap=True, highlight=False)
