# SPDX-License-Identifier: Apache-2.0
"""`haptic passivity`: is this display passive, is it stable, by how much, and what to change."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column

from haptic_device.config.description import load_device
from haptic_device.config.kinematics import CLEAR
from haptic_device.digits import amount, apart, plain
from haptic_device.theory.assessment import Display, advise, assess, coulomb_friction_needed, hidden_stiffness
from haptic_device.theory.felt import damped, delays, felt_at, figures
from haptic_display.cli.completion import shipped
from haptic_display.cli.numbers import number
from haptic_display.cli.words import console, next_step, print_sentence, refused, table

_DAMPING = "Physical damping b of the device (N s/m); of a linkage's joints, all alike (N m s/rad)."
_DEVICE = "Take b, m, friction, encoder step and delays from this description (a name in config/devices or a file)."
_JOINTS = "Pose of a linkage: A,B (degrees) [the worst pose of its workspace]."
_POSITION = "The same by the handle's place in the linkage's frame: X,Y (m)."
_PLOT = "Write the K-B plane, or of a linkage the map of its workspace, to this PNG file."
_STAMP_ERROR = "Half-width of what is not known of a sample's time (s)."


def passivity(
    context: typer.Context,
    stiffness: Annotated[float, number("N/m", help="Stiffness K of the wall or coupling (N/m).")],
    damping: Annotated[float, number("N s/m", help="Its virtual damping B, of either sign (N s/m).")],
    period: Annotated[float, number("s", help="Servo period T (s).")],
    physical_damping: Annotated[float | None, number("N s/m", help=_DAMPING)] = None,
    device: Annotated[str | None, typer.Option(help=_DEVICE, autocompletion=shipped("devices"))] = None,
    joints: Annotated[str | None, typer.Option(help=_JOINTS)] = None,
    position: Annotated[str | None, typer.Option(help=_POSITION)] = None,
    mass: Annotated[float | None, number("kg", help="Moving mass m (kg); only stability needs it [0.1].")] = None,
    delay_samples: Annotated[float | None, number("periods", help="Loop delay in periods, fractions too [0].")] = None,
    stamp_error: Annotated[float | None, number("s", 0.0, 1.0, help=f"{_STAMP_ERROR} [0]")] = None,
    velocity_lag: Annotated[float, number("s", help="Time constant of the velocity filter (s).")] = 0.0,
    resolution: Annotated[float | None, number("m", help="Encoder step (m); 0 leaves quantization out [0].")] = None,
    coulomb: Annotated[float | None, number("N", help="Coulomb friction of the device (N) [0].")] = None,
    plot: Annotated[Path | None, typer.Option(help=_PLOT)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Passivity and stability of a wall or coupling on a sampled device (Colgate, Stanley & Brown 1995)."""
    if physical_damping is None and device is None:
        context.fail("Missing option '--physical-damping'.")
    options = {"mass": mass, "delay_samples": delay_samples, "resolution": resolution, "coulomb": coulomb}
    options |= {"physical_damping": physical_damping, "stamp_error": stamp_error}
    with refused("passivity"):
        of, pose, worst = _described(device, joints, position, physical_damping)
        known = {} if of is None else figures(of, pose) | delays(of, period)
        known |= {name: value for name, value in options.items() if value is not None}
        if pose:
            known["physical_damping"] = pose.damping  # that was given is the joints'
        late = known.pop("stamp_error", 0.0)
        if period > 0.0:  # a sample may be that much older than its stamp
            known["delay_samples"] = known.get("delay_samples", 0.0) + late / period
        display = Display(stiffness, damping, period=period, velocity_lag=velocity_lag, **known)
        # of a device the damping decides, as in its driver; friction and encoder step are a verdict of their own
        judged = display if of is None else display._replace(resolution=0.0)
        assessment = assess(judged)
        if plot is not None:
            _plot(of, pose, worst, judged, assessment, plot)
    advice = advise(judged, assessment)
    found = {**display._asdict(), **assessment._asdict(), "advice": advice}
    if of is not None:
        needed = float(coulomb_friction_needed(stiffness, damping, period, display.resolution, velocity_lag))
        assessment = assessment._replace(coulomb_required=needed)
        found |= {"coulomb_required": needed, "stiffness_max_friction": hidden_stiffness(display)}
    if as_json:
        typer.echo(json.dumps(_report(found, pose)))
        return
    _show(display, assessment, of, pose, advice)
    most = math.inf
    if worst:  # what the driver allows
        there = assess(judged._replace(physical_damping=worst.damping))
        most = min(there.stiffness_max_passive, there.stiffness_max_mu)
    if of is not None:
        _tell(pose, worst, most, display)
    next_step(_next(display, assessment, most))


def _described(name, joints, position, damping):
    """Device, pose of a linkage, and the worst of its workspace; None: there is none."""
    if joints is not None and position is not None:
        raise ValueError(f"--joints is {joints} and --position is {position}: give one of them")
    device = None if name is None else load_device(name)
    if not (device and device.joints):
        if joints or position:
            what = f"{device.name} has motors on its axes" if device else "no --device is given"
            raise ValueError(f"--{'joints' if joints else 'position'} is of a linkage, and {what}")
        return device, None, None
    device = device if damping is None else damped(device, damping)
    worst = felt_at(device)
    return device, felt_at(device, joints, position) if joints or position else worst, worst


def _plot(device, pose, worst, display, assessment, path):
    if device is not None and len(device.joints) == 2:
        from haptic_device.theory.workspace_figure import save_workspace

        save_workspace(device, pose, worst, display, path)
    else:
        from haptic_device.theory.passivity_figure import save_map

        save_map(display, assessment, path)


def _report(found, pose):
    """Inputs, results and the advice; JSON has no infinity, so a need without end is null."""
    finite = {key: value if key == "advice" or math.isfinite(value) else None for key, value in found.items()}
    return finite if pose is None else finite | {"pose": pose.values}


def _show(display, assessment, device, pose, advice):
    columns = "question", *(Column(each, justify="right") for each in ("answer", "has", "needs"))
    where = f"{device.name}{f', worst direction with{chr(10)}{pose.told}' if pose else ''}\n" if device else ""
    title = where + _heading(display)
    console().print(table(columns, _rows(display, assessment), title=title, title_justify="left"))
    print_sentence(advice)


def _tell(pose, worst, limit, display):
    """Of a device: which pose that is and what helps, and up to which stiffness friction hides the encoder's step."""
    if pose is not None and pose.singular < CLEAR:
        print_sentence(f"So near to a singular pose (c = {pose.singular:.2g}, below {CLEAR:g}) all forces fade.")
    if pose is not None and len(pose.joints) == 2:
        there = f", {worst.told}, where K < {plain(limit, digits=4)} N/m"
        print_sentence(
            f"The driver goes by the worst pose of the workspace{', this one' if pose is worst else there}: a smaller "
            "use_workspace without it allows more; joints with more damping or a shorter period do everywhere."
        )
    if display.resolution > 0.0:
        step, hidden = amount(display.resolution, "m"), plain(hidden_stiffness(display), "N/m", digits=4)
        what = f"limit cycles of the encoder step, {step}"
        friction = f"Friction of {amount(display.coulomb, 'N')} hides {what}, up to {hidden}."
        print_sentence(friction if display.coulomb > 0.0 else f"Without friction nothing hides {what}.")


def _next(display, assessment, most=math.inf):
    if assessment.passive and assessment.mu_passive:
        if display.stiffness >= most:
            return "a use_workspace around this pose, in the description"
        wanted = {"coupling.damping": display.damping, "coupling.stiffness": display.stiffness}
        return "; ".join(f"haptic set haptic_driver {name} {value:g}" for name, value in wanted.items())
    limit = min(assessment.stiffness_max_passive, assessment.stiffness_max_mu)
    other = f"--stiffness {plain(0.9 * limit, digits=2)}" if limit > 0.0 else "another --damping"
    return f"the same with {other}, or more --physical-damping"


def _rows(display, assessment):
    damping, stiffness = ("b", "N s/m", display.physical_damping), ("K", "N/m", display.stiffness)
    limit, coupled = assessment.stiffness_max_passive, assessment.stiffness_max_mu
    yield _row("passive wall, any operator", assessment.margin > 0.0, *damping, ">", assessment.b_required)
    coupling = "passive coupling, any simulation"
    yield _row(coupling, assessment.mu_passive, *damping, ">", assessment.b_required_mu)
    if display.resolution > 0.0:
        friction, needed = display.coulomb, assessment.coulomb_required
        yield _row("encoder step covered by friction", friction >= needed, "f", "N", friction, "≥", needed)
    yield _row("soft enough as a passive wall", stiffness[2] < limit, *stiffness, "<", limit)
    yield _row("soft enough as a passive coupling", stiffness[2] < coupled, *stiffness, "<", coupled)
    yield _row("stable when nobody holds it", assessment.stable, *stiffness, "<", assessment.stiffness_max_stable)


def _row(question, holds, symbol, unit, has, sign, needs):
    """Has and needs with enough digits to see that one is beyond the other."""
    told, limit = apart(has, needs)
    needed = f"{symbol} {sign} {limit} {unit}" if math.isfinite(needs) else f"no {symbol} is enough"
    return question, ("yes", "green") if holds else ("no", "red"), f"{symbol} = {told} {unit}", needed


def _heading(display):
    return (
        f"K = {display.stiffness:g} N/m, B = {display.damping:g} N s/m, b = {display.physical_damping:g} N s/m, "
        f"T = {display.period:g} s, m = {display.mass:g} kg,\ndelay {display.delay_samples:g} T, velocity lag "
        f"{display.velocity_lag:g} s, encoder step {display.resolution:g} m, friction {display.coulomb:g} N"
    )
