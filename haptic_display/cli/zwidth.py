# SPDX-License-Identifier: Apache-2.0
"""`haptic zwidth`: which walls a device shows without shaking: as a map of its model, or live on the running nodes."""

import json
import os
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from haptic_device.digits import amount, plain
from haptic_display.cli.completion import shipped
from haptic_display.cli.numbers import number, whole
from haptic_display.cli.progress import SCHEDULER, progress
from haptic_display.cli.words import console, next_step, print_sentence, refused, shown_path, table

_DEVICE = "Take m, b, friction, encoder step and delays from this x axis, or a linkage's worst pose (name or file)."
_DAMPING = "Physical damping b (N s/m) [0.5]; of a linkage's joints, all alike (N m s/rad)."
_LIVE = "Raise the wall's stiffness on driver and loopback until it shakes, instead of drawing the map of a model."
_LATENESS = "Also draw: writes late by anything up to this (s), at most T/2."
_OPERATOR = "none, light, firm, or worst of a grid of masses and springs."
_DOMAIN = "With --live: ROS domain of nodes that run already, the hand's motion being follow."
LIVE_ONLY = "damping", "domain", "namespace"
SHARES = {"quiet": "quiet", "gives": "energy given to the operator", "shakes": "shaking"}
FIGURES = (  # of live walls: words, and keys
    ("stiffest wall that stands still [N/m]", "quiet"),
    ("softest wall that shakes [N/m]", "shaking"),
    ("damping felt in free space [N s/m]", "damping", "none"),
    ("the same, 95 % cancelled [N s/m]", "damping", "cancelled"),
)
TITLE = "Largest stiffness of a wall: by simulation, and by theory"
EITHER = "device", "period", "stiffness_max", "as_json"


def zwidth(
    context: typer.Context,
    device: Annotated[str | None, typer.Option(help=_DEVICE, autocompletion=shipped("devices"))] = None,
    mass: Annotated[float | None, number("kg", help="Moving mass m (kg) [0.1].")] = None,
    physical_damping: Annotated[float | None, number("N s/m", help=_DAMPING)] = None,
    period: Annotated[float, number("s", help="Servo period T (s).")] = 0.001,
    delay_samples: Annotated[float | None, number("periods", help="Loop delay in periods [0].")] = None,
    velocity_lag: Annotated[float, number("s", help="Time constant of the velocity filter (s).")] = 0.0,
    resolution: Annotated[float | None, number("m", help="Encoder step (m) [0].")] = None,
    coulomb: Annotated[float | None, number("N", help="Coulomb friction (N) [0].")] = None,
    lateness: Annotated[float, number("s", help=_LATENESS)] = 0.0,
    operator: Annotated[str, typer.Option(help=_OPERATOR)] = "none",
    stiffness_max: Annotated[float | None, number("N/m", help="Largest K of the map (N/m) [by theory].")] = None,
    damping_max: Annotated[float | None, number("N s/m", help="Largest B of the map (N s/m) [4 b].")] = None,
    points: Annotated[int, whole(2, 1000, help="Cells along each axis.")] = 100,
    seconds: Annotated[float, number("s", help="Simulated time of a cell (s).")] = 1.0,
    out: Annotated[Path, typer.Option(help="Folder for map.csv and map.png.")] = Path("zwidth"),
    workers: Annotated[int | None, whole(1, 1024, help="Threads [one a core].")] = None,
    scheduler: Annotated[str, typer.Option(help=SCHEDULER)] = "",
    live: Annotated[bool, typer.Option("--live", help=_LIVE)] = False,
    damping: Annotated[float, number("N s/m", help="With --live: virtual damping B of the wall (N s/m).")] = 0.0,
    domain: Annotated[int | None, whole(0, 232, help=_DOMAIN)] = None,
    namespace: Annotated[str | None, typer.Option(help="With --live: namespace of nodes that run already.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
):
    """Z-width of a device: the K-B plane of walls it can show (Colgate & Brown 1994), in lock-step simulation."""
    given = {"mass": mass, "physical_damping": physical_damping, "delay_samples": delay_samples, "coulomb": coulomb}
    given = {name: value for name, value in {**given, "resolution": resolution}.items() if value is not None}
    with refused("zwidth", "the gains are as they were" if live else f"rows that were done are in {out / 'map.csv'}"):
        _refuse_options_of_the_other_mode(context, live)
        if live:
            found = _measure(device or "desktop", period, damping, stiffness_max, domain, namespace)
        else:
            given |= {"period": period, "velocity_lag": velocity_lag, "seconds": seconds}
            cells = operator, stiffness_max, damping_max, points
            found = _draw(device, given, cells, lateness, out, workers or len(os.sched_getaffinity(0)), scheduler)
    if as_json:
        typer.echo(json.dumps(found))
    else:
        (_show_live if live else _show)(found)
        next_step(_next(found, live))


def _refuse_options_of_the_other_mode(context: typer.Context, live: bool):
    sources = {name: context.get_parameter_source(name) for name in context.params if name not in (*EITHER, "live")}
    given = [name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"]
    if wrong := ", ".join(f"--{name.replace('_', '-')}" for name in given if (name in LIVE_ONLY) is not live):
        raise ValueError(f"with --live, {wrong} has no meaning" if live else f"{wrong} needs --live")


def _next(found, live):
    if not live:
        return f"open {shown_path(found['figure'])}; haptic zwidth --live tries the walls on a device"
    quiet = found["live"]["quiet"]
    if quiet is None:
        return "haptic passivity says why"
    return f"haptic demo --scene wall --view; walls up to {plain(quiet, 'N/m')} stand still"


def _draw(device, given, cells, lateness, out, workers, scheduler):
    from haptic_device.config.description import load_device
    from haptic_device.theory.felt import damped, felt_at
    from haptic_display.device_tools.zwidth_plane import Setup, device_figures, request_of, write_map, write_workspace

    base, pose = {"mass": 0.1, "physical_damping": 0.5}, None
    if device is not None:
        device = load_device(device)
        if device.joints:
            damping = given.pop("physical_damping", None)
            device = device if damping is None else damped(device, damping)
            pose = felt_at(device)
        base = device_figures(device, pose, given["period"])
    request = request_of(Setup(**base | given), *cells)
    rows = request.damping.size
    with progress(rows) as show:
        found = write_map(request, lateness, out, workers, scheduler, lambda done: show(done, "rows of the map"))
    if pose is None:
        return found
    return found | write_workspace(device, pose, request.setup, out) | {"where": pose.told}


def _measure(name, period, damping, stiffness_max, domain, namespace):
    from rich.console import Console

    from haptic_display.device_tools.zwidth import measure, plan

    wanted = plan(name, period, damping, stiffness_max)
    with Console(stderr=True).status("starting") as status:
        return measure(wanted, domain, namespace, status.update)


def _show_live(found):
    rows = ((label, *(_number(found[side], keys) for side in ("live", "lockstep"))) for label, *keys in FIGURES)
    title = f"Z-width at {found['rate']:g} Hz, B = {found['damping']:g} N s/m"
    console().print(table(("figure", "live", "lock-step"), rows, title=title))
    at_bound = _at_bound(found["at_95_percent_of_passive"])
    print_sentence(f"passive up to {plain(found['passive'], 'N/m')}{at_bound}")


def _at_bound(found):
    if found["shaking"] is None:
        return ""
    shakes = "shakes" if found["shaking"] else "stands still"
    return f"; a wall at 95 % of that {shakes} and gives {amount(found['energy_given'], 'J')} to the hand"


def _number(values, keys):
    for key in keys:
        values = values[key]
    return _told(values)


def _told(value):
    return "none" if value is None else plain(value)


def _show(found):
    lines, run = found["stiffness_max"], {"quiet": "all quiet up to", "not_shaking": "none shakes up to"}
    heads = (f"{run.get(name, name.replace('_', ' '))} [N/m]" for name in lines)
    some = np.unique(np.linspace(0, len(found["damping"]) - 1, 9).astype(int))
    rows = ([_told(line[i]) for line in (found["damping"], *lines.values())] for i in some)
    console().print(table(("B [N s/m]", *heads), rows, title=TITLE))
    shares = ", ".join(f"{SHARES[name]} in {plain(100 * share)} %" for name, share in found["shares"].items())
    print_sentence(f"{found['cells']} cells with operator {found['operator']}: {shares}")
    if "where" in found:
        print_sentence(f"All of it is at the worst pose of the workspace, in its worst direction: {found['where']}")
    print(f"map     {found['csv']}\nfigure  {found['figure']}")
    if "workspace" in found:
        print(f"places  {found['workspace']}")
