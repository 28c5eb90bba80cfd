# SPDX-License-Identifier: Apache-2.0
"""`haptic identify`: shakes the connected device, and writes what it is made of as a device description."""

import json
import time
from pathlib import Path
from typing import Annotated

import typer

INTERRUPTED = 130
WALLS = ("wall.normals", "wall.offsets", "wall.stiffness", "wall.damping")
QUIET = ("coupling.stiffness", "coupling.damping", "cancellation.ratio")
SETTLING = 1.0  # [s] of the trace that is left out: the handle comes to the first centre
_DEVICE = "Device description that the driver has, the beginning of the search (a name in config/devices or a file)."
_LOOPBACK = "Description of the loopback that is started, if it is to be another device."
_DOMAIN = "Identify the driver that runs in this ROS domain, with nobody holding the handle."


def identify(
    out: Annotated[Path, typer.Option(help="Device description to write.")] = Path("identified.yaml"),
    device: Annotated[str, typer.Option(help=_DEVICE)] = "desktop",
    loopback: Annotated[str | None, typer.Option(help=_LOOPBACK)] = None,
    seconds: Annotated[float, typer.Option(min=3.0, max=600.0, help="How long it is shaken (s).")] = 8.0,
    force: Annotated[float, typer.Option(help="Largest force of the shaking on each axis (N).")] = 3.0,
    rate: Annotated[float, typer.Option(help="Servo rate of a driver that is started here (Hz).")] = 4000.0,
    domain: Annotated[int | None, typer.Option(min=0, max=232, help=_DOMAIN)] = None,
    namespace: Annotated[str | None, typer.Option(help="Namespace of the running driver.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
):
    """Mass, damping, friction, encoder step and delay of the connected device, with 95 % confidence."""
    from haptic_sim.cli.processes import NodeDiedError, interruptible

    try:
        with interruptible():
            found, described = _identify(device, loopback, seconds, force, rate, domain, namespace)
        write(out, described, found)
    except (ValueError, OSError, NodeDiedError) as error:
        typer.echo(f"haptic identify: {error}", err=True)
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        typer.echo("haptic identify: interrupted; the walls are as they were", err=True)
        raise typer.Exit(INTERRUPTED) from None
    report = {"device": described.name, "file": str(out), "axes": found}
    typer.echo(json.dumps(report)) if as_json else _show(report)


def _identify(name, loopback, seconds, force, rate, domain, namespace):
    from haptic_device.analysis.quantity import positive
    from haptic_device.device import load_device
    from haptic_device.share import find
    from haptic_sim.cli.bench_nodes import running

    positive("force", force, "N")
    described = load_device(name)
    other = load_device(loopback) if loopback else described
    if len(other.axes) != len(described.axes):
        raise ValueError(f"--loopback has {len(other.axes)} axes and --device {len(described.axes)}")
    _refuse_force(described, force)
    told = {"device": str(Path(find("devices", name)).absolute()), "servo.rate": rate}
    true = {"device": str(Path(find("devices", loopback or name)).absolute()), **dict.fromkeys(_hand(), 0.0)}
    with running(domain, namespace, told, true) as (number, room, check):
        rows = record(number, room, check, described, seconds, force)
    return {axis.name: estimate(rows, i, axis) for i, axis in enumerate(described.axes[:2])}, described


def _hand():
    parts = ("mass", "damping", "stiffness", "rotational_mass", "rotational_damping", "rotational_stiffness")
    return tuple(f"hand.{part}" for part in parts)


def _refuse_force(device, force):
    for axis in device.axes[:2]:
        if force > axis.motor_limit:
            raise ValueError(
                f"force is {force:g} N, but the motor of axis {axis.name} gives at most {axis.motor_limit:g} N"
            )


def record(domain, namespace, check, described, seconds, force):
    """Rows of the longest unbroken trace of the shaking; the driver's parameters are put back in any case."""
    from haptic_device.analysis.excitation import shakes
    from haptic_sim.cli.tuning import Tuning

    tuning = Tuning(domain, namespace, trace=True)
    try:
        tuning.wait_engaged(check)
        with tuning.as_found((*WALLS, *QUIET)) as found:
            if found["wall.offsets"]:
                raise ValueError(f"the driver shows {len(found['wall.offsets'])} walls; identify it in free space")
            tuning.set(coupling__stiffness=0.0, coupling__damping=0.0, cancellation__ratio=0.0)
            centres = _centres(tuning, described)
            damping = min(axis.damping for axis in described.axes[:2])
            plan, end = shakes(centres, force, damping, _period(tuning)), time.monotonic() + seconds + SETTLING
            while time.monotonic() < end:
                shake = next(plan)
                tuning.set(
                    wall__normals=shake.normals, wall__offsets=shake.offsets, wall__stiffness=shake.stiffness,
                    wall__damping=shake.damping,
                )  # fmt: skip
                tuning.watch(shake.seconds)
                check()
        return _unbroken(tuning.rows)
    finally:
        tuning.close()


def _period(tuning):
    return 1.0 / float(tuning.get(["servo.rate"])["servo.rate"])


def _centres(tuning, device):
    """Where the handle is, but not in the outer fifth of its workspace."""
    centres = []
    for axis in device.axes[:2]:
        low, high = axis.workspace
        at, inset = tuning.truths[-1][axis.name][0], 0.2 * (high - low)
        centres.append(min(high - inset, max(low + inset, at)))
    return centres


def _unbroken(blocks):
    """The longest run of ticks without a gap, less its beginning."""
    import numpy as np

    rows = np.concatenate(blocks) if blocks else np.zeros(0, [("tick", "f8")])
    if not len(rows):
        raise ValueError("no trace came from haptic_driver; is publish.trace off?")
    edges = np.concatenate([[0], np.flatnonzero(np.diff(rows["tick"]) != 1.0) + 1, [len(rows)]])
    longest = np.argmax(np.diff(edges))
    run = rows[edges[longest] : edges[longest + 1]]
    late = run["deadline"] >= run["deadline"][0] + SETTLING * 1e9
    return run[late]


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

    delay = max(0.0, sum(axis["delay"][0] for axis in found.values()) / len(found))
    content = described.model_dump(mode="json")
    for axis in content["axes"]:
        for name in ("mass", "damping", "coulomb") if axis["name"] in found else ():
            axis[name] = round(max(0.0, found[axis["name"]][name][0]), 9)
    content |= {"name": f"{described.name}_identified", "sensing_delay": 0.0, "actuation_delay": round(delay, 9)}
    lines = [f"#   {name}: {_line(values)}" for name, values in found.items()]
    left = [axis.name for axis in described.axes if axis.name not in found]
    head = "# Identified by haptic identify, ± 95 % confidence. Only the sum of both delays can be told: it stands as\n"
    head += "# actuation_delay." + (f" Not shaken, as described: {', '.join(left)}." if left else "") + "\n"
    path.write_text(head + "\n".join(lines) + "\n" + yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


_UNITS = {
    "mass": "kg",
    "damping": "N s/m",
    "coulomb": "N",
    "bias": "N",
    "delay": "s",
    "resolution": "m",
    "residual": "m",
}


def _line(values):
    return ", ".join(f"{name} {_text(*pair)} {_UNITS[name]}" for name, pair in values.items())


def _text(value, confidence):
    return f"{value:.5g}" if confidence is None else f"{value:.5g} ± {confidence:.2g}"


def _show(report):
    from rich.console import Console
    from rich.table import Table

    table = Table("axis", *(f"{name} [{unit}]" for name, unit in _UNITS.items()), title=report["device"])
    for axis, values in report["axes"].items():
        table.add_row(axis, *(_text(*values[name]) for name in _UNITS))
    console = Console(width=None if Console().is_terminal else 140)
    console.print(table)
    console.print(f"description  {report['file']}", soft_wrap=True, highlight=False)
