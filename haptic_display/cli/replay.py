# SPDX-License-Identifier: Apache-2.0
"""`haptic replay`: a recorded hand on other gains, in lock-step; or the recorded servo computed again to the bit."""

import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from haptic_display.cli.completion import shipped
from haptic_display.cli.numbers import number
from haptic_display.cli.words import next_step, shown_path

_PARAMS = "Operating point in place of the bag's own values."


class As(StrEnum):
    """What the recorded hand is in the replay."""

    target = "target"
    device = "device"


def replay(
    bag: Annotated[Path, typer.Argument(help="Bag folder or .mcap file.")],
    as_: Annotated[As, typer.Option("--as", help="The hand's target, or the device's own position.")] = As.target,
    check: Annotated[bool, typer.Option("--check", help="Compute the recorded ticks again, bit for bit.")] = False,
    params: Annotated[str | None, typer.Option(help=_PARAMS, autocompletion=shipped(""))] = None,
    delay: Annotated[float, number("s", 0.0, 10.0, help="Delay of the exchange there and back [s].")] = 0.0,
    out: Annotated[Path | None, typer.Option(help="New bag of the replay [haptic_bags/replay-TIME].")] = None,
    namespace: Annotated[str | None, typer.Option(help="Where the bag holds several devices.")] = None,
) -> None:
    """Play a recorded hand motion in lock-step, into a new bag. With --check: exit code 1 if one bit differs."""
    if check:
        _refuse({"--as device": as_ is As.device, "--params": params is not None, "--delay": delay > 0.0, "--out": out})
        _check(bag, namespace)
        return
    from haptic_display.cli.tables import print_comparison, print_notes
    from haptic_display.run.report.reading import read_run
    from haptic_sim.lockstep import rerun
    from haptic_sim.lockstep.lockstep import Network

    out = out or Path("haptic_bags") / time.strftime("replay-%Y%m%d-%H%M%S")
    changes, recording = rerun.given_at(params), rerun.recorded(bag, namespace)
    print_notes(bag, recording.notes)
    point = rerun.recorded_point(recording, changes)
    rerun.replay(rerun.hand_of(recording, as_ is As.device), point, Network(delay), out)
    print_comparison({"recorded": read_run(bag, namespace), "replayed": read_run(out)})
    typer.echo(f"bag {out}")
    next_step(f"haptic report {shown_path(bag)} {shown_path(out)}")


def _refuse(given: dict[str, object]) -> None:
    if chosen := [option for option, value in given.items() if value]:
        raise ValueError(f"replay --check takes no {', '.join(chosen)}: leave it out, or leave --check out")


def _check(bag: Path, namespace: str | None) -> None:
    from haptic_device.recording import load
    from haptic_display.cli.tables import print_notes
    from haptic_sim.lockstep.trace_verification import verdict_on

    recording = load(bag, namespace, dict.fromkeys(("trace", "snapshot", "local_contacts")))
    print_notes(bag, recording.notes)
    if "snapshot" not in recording.clouds:
        raise ValueError(f"bag {bag} has no snapshot of the servo's settings: its ticks cannot be computed again")
    found = verdict_on(recording.trace, recording.clouds["snapshot"], recording.clouds.get("local_contacts"))
    typer.echo(f"{found.same} ticks computed again are bit-identical")
    if found.skipped:
        typer.echo(f"{found.skipped} ticks had no snapshot before them, without which they cannot be computed")
    if found.different or not found.same:
        columns = ", ".join(found.columns)
        raise ValueError(f"{found.different} ticks differ, the first is {found.first}, in {columns or 'nothing'}")
