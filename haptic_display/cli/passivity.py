# SPDX-License-Identifier: Apache-2.0
"""`haptic passivity`: is this display passive, is it stable, by how much, and what to change."""

import json
import math
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column

from haptic_device.digits import apart, plain
from haptic_device.theory.assessment import Display, advise, assess
from haptic_display.cli.numbers import number
from haptic_display.cli.words import console, next_step, print_sentence, refused, table

_STAMP_ERROR = "Half-width of what is not known of a sample's time (s)."


def passivity(
    stiffness: Annotated[float, number("N/m", help="Stiffness K of the wall or coupling (N/m).")],
    damping: Annotated[float, number("N s/m", help="Its virtual damping B, of either sign (N s/m).")],
    physical_damping: Annotated[float, number("N s/m", help="Physical damping b of the device (N s/m).")],
    period: Annotated[float, number("s", help="Servo period T (s).")],
    mass: Annotated[float, number("kg", help="Moving mass m of the device (kg); only stability needs it.")] = 0.1,
    delay_samples: Annotated[float, number("periods", help="Loop delay in periods, fractions allowed.")] = 0.0,
    stamp_error: Annotated[float, number("s", 0.0, 1.0, help=_STAMP_ERROR)] = 0.0,
    velocity_lag: Annotated[float, number("s", help="Time constant of the velocity filter (s).")] = 0.0,
    resolution: Annotated[float, number("m", help="Encoder step (m); 0 leaves quantization out.")] = 0.0,
    coulomb: Annotated[float, number("N", help="Coulomb friction of the device (N).")] = 0.0,
    plot: Annotated[Path | None, typer.Option(help="Write the K-B plane to this PNG file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
):
    """Passivity and stability of a wall or coupling on a sampled device (Colgate, Stanley & Brown 1995)."""
    if period > 0.0:  # a sample may be that much older than its stamp
        delay_samples += stamp_error / period
    display = Display(
        stiffness, damping, physical_damping, period, mass, delay_samples, velocity_lag, resolution, coulomb
    )
    with refused("passivity"):
        assessment = assess(display)
        if plot is not None:
            from haptic_device.theory.passivity_figure import save_map

            save_map(display, assessment, plot)
    if as_json:
        typer.echo(json.dumps(_report(display, assessment)))
    else:
        _show(display, assessment)
        next_step(_next(display, assessment))


def _report(display, assessment):
    """Inputs, results and the advice; JSON has no infinity, so a need without end is null."""
    values = {**display._asdict(), **assessment._asdict()}
    finite = {key: value if math.isfinite(value) else None for key, value in values.items()}
    return {**finite, "advice": advise(display, assessment)}


def _show(display, assessment):
    columns = "question", *(Column(each, justify="right") for each in ("answer", "has", "needs"))
    console().print(table(columns, _rows(display, assessment), title=_heading(display), title_justify="left"))
    print_sentence(advise(display, assessment))


def _next(display, assessment):
    if assessment.passive and assessment.mu_passive:
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
