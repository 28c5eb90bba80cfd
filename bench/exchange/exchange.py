# SPDX-License-Identifier: Apache-2.0
"""What each exchange method makes of a network, in lock-step, at handle and tool."""

import csv
import itertools
import json
import os
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from bench.exchange import round_trip
from bench.exchange.exchange_live import run as run_live
from bench.jobs import WORKERS, Kept, sweep
from haptic_device.config_files import find
from haptic_device.description import load_device
from haptic_device.parameter_files import read_operating_point
from haptic_device.parameters import EXCHANGE_METHODS, OPERATING_POINT
from haptic_sim.cli.progress import SCHEDULER
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.node_parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.replay.lockstep import Lockstep, Network
from haptic_sim.scene.language import load

PATIENT = {"exchange.hold": 0.5, "exchange.fade": 0.5}  # a study of long delays does not let the tool go
PRESS = {"motion.name": "press_wall", "motion.start": (0.03, 0.0, 0.0), "motion.target": (0.005, 0.0, 0.0)}
CIRCLE = {"motion.name": "circle", "motion.start": (0.0, 0.0, 0.0), "motion.radius": 0.03, "motion.turns": 3.0}
SECONDS = 3.0
_DELAYS, _RATES = "Round trip (ms) [0 1 2 5 10 20 50 100].", "Handle samples a second [1000]."
_CSV = "CSV file for the figures, each as it comes; cases that are in it are not done again."
_ROUND_TRIP = "Handle to tool to handle on running nodes at each rate [500 1000 2000], beside a bare ping-pong."
BUDGET = next(one.default for one in OPERATING_POINT if one.name == "exchange.budget")  # [J]
TURNING = 2.0 * np.pi * 3.0 / (0.9 * SECONDS)  # [rad/s] between easing in and out


class Case(NamedTuple):
    """A method and a network: delay of both ways together and its jitter [s], loss of a turn, samples a second."""

    method: str
    delay: float
    jitter: float
    loss: float
    rate: float


class Figures(NamedTuple):
    """Contact stiffness felt [N/m]; free motion: tool error [m], apparent damping [N s/m] and mass [kg]; the largest
    energy given to the operator and supplied to the tool in either [J]; the fastest change of force [N/ms]."""

    stiffness: float
    tool_error: float
    damping: float
    mass: float
    given: float
    supplied: float
    jump: float

    @property
    def impedance_ratio(self) -> float:
        """Contact stiffness over free-space drag [1/s]."""
        return self.stiffness / max(1e-3, abs(self.damping))

    @property
    def passive(self) -> bool:
        """Whether no more energy than the default of `exchange.budget` was given; the rest means little if not."""
        return self.given <= BUDGET


_HOW = ("params", str), ("live", bool)
Row = NamedTuple("Row", [*Case.__annotations__.items(), *_HOW, *Figures.__annotations__.items()])


def main(
    method: Annotated[list[str] | None, typer.Option(help="Exchange method; may be repeated [all].")] = None,
    delay: Annotated[list[float] | None, typer.Option(help=_DELAYS, min=0.0, max=2000.0)] = None,
    jitter: Annotated[float, typer.Option(help="Uniform jitter, ± share of the delay.", min=0.0, max=1.0)] = 0.0,
    loss: Annotated[list[float] | None, typer.Option(help="Share of turns lost [0].", min=0.0, max=1.0)] = None,
    rate: Annotated[list[float] | None, typer.Option(help=_RATES, min=100.0, max=2000.0)] = None,
    params: Annotated[str, typer.Option(help="Operating point: a name in config or a YAML file.")] = "demo",
    plot: Annotated[Path | None, typer.Option(help="Write the figure to this PNG file.")] = None,
    table: Annotated[Path | None, typer.Option("--csv", help=_CSV)] = None,
    live: Annotated[bool, typer.Option("--live", help="On running nodes behind a relay, not in lock-step.")] = False,
    round_trip: Annotated[bool, typer.Option("--round-trip", help=_ROUND_TRIP)] = False,
    workers: Annotated[int | None, typer.Option(min=1, max=1024, help=WORKERS)] = None,
    scheduler: Annotated[str, typer.Option(help=SCHEDULER)] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of the table.")] = False,
) -> None:
    """Exchange methods against delay, jitter, loss and rate: stiffness, tool error, drag, energies, force jumps.

    Two motions a case, of 3 s each: pressing a rigid wall, and a circle in free space.
    """
    if round_trip:
        _round_trip(rate, table, as_json)
        return
    delays = [value * 1e-3 for value in delay or (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)]
    cases = [
        Case(name, late, jitter * late, lost, fast)
        for lost, fast, late, name in itertools.product(
            loss or (0.0,), rate or (1000.0,), delays, method or EXCHANGE_METHODS
        )
    ]
    kept = Kept(table, Row, lambda row: row[:7])
    jobs = {(*case, params, live): (case, params, live) for case in cases}
    sweep(_row, jobs, kept, 1 if live else workers or len(os.sched_getaffinity(0)), scheduler)
    found = {case: Figures(*kept.known[key][7:]) for key, (case, *_) in jobs.items()}
    if plot is not None:
        from bench.exchange.exchange_figure import save  # which takes its kinds from here

        save(found, plot)
    rows = [
        {**case._asdict(), **one._asdict(), "impedance_ratio": one.impedance_ratio, "passive": one.passive}
        for case, one in found.items()
    ]
    if as_json:
        typer.echo(json.dumps({"live": live, "params": params, "cases": rows}))
    else:
        _show(found, "live" if live else "lock-step")


def _round_trip(rates, path, as_json):
    found = round_trip.measure(rates or round_trip.RATES)
    if path is not None:
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(found[0]))
            writer.writeheader()
            writer.writerows(found)
    typer.echo(json.dumps(found) if as_json else round_trip.table(found))


def _row(case, params, live):
    return Row(*case, params, live, *measure(case, params, live))


def measure(case: Case, params: str = "demo", live: bool = False) -> Figures:
    """Figures of one case at an operating point; ValueError, one sentence, for values that cannot be."""
    run = _run_live if live else _run
    pressed, press = run(case, params, "wall", PRESS)
    led, circle = run(case, params, "free_space", CIRCLE)
    held = pressed[int(0.55 * len(pressed)) : int(0.68 * len(pressed))]
    steady = led[int(0.2 * len(led)) : int(0.8 * len(led))]
    damping, mass = _drag(steady)
    return Figures(
        float(held.force_coupling[:, 0].mean() / (0.01 - held.position[:, 0].mean())),
        circle["error"],
        damping,
        mass,
        max(press["given"], circle["given"]),
        max(press["supplied"], circle["supplied"]),
        max(_jump(pressed), _jump(led)),
    )


def _run(case, params, scene, motion):
    """Rows of a motion in a scene; and the mean tool error and the largest energies on the way."""
    given = read_operating_point(find("", params), NODES)
    values = {node: {one.name: one.default for one in NODES[node]} | given.get(node, {}) for node in NODES}
    driver = values["haptic_driver"] | PATIENT | {"exchange.method": case.method, "exchange.rate": case.rate}
    loopback = values["haptic_loopback"] | motion | {"motion.duration": SECONDS}
    simulated = values["haptic_simulation"] | {"max_catch_up": 0.5, "exchange.method": case.method}
    simulation = Simulation.by_parameters(reduce_scene(load(scene), simulated["method"]), simulated)
    network = Network(case.delay, case.jitter, case.loss, 1)
    system = Lockstep(load_device(driver["device"]), driver, loopback, simulation, network)
    rows, errors, given, supplied = [], [], 0.0, 0.0
    for _ in range(int(SECONDS * 1000)):
        rows.append(system.run(1e-3))
        errors.append(np.hypot(*(rows[-1].position[-1] - simulation.method.position)[:2]))
        given = max(given, float(system.plant_memory["energy_given"][0]))
        supplied = max(supplied, simulation.ledger.supplied)
    middle = errors[len(errors) // 5 : 4 * len(errors) // 5]
    told = {"error": float(np.mean(middle)), "given": given, "supplied": supplied}
    return np.concatenate(rows).view(np.recarray), told


def _run_live(case, params, scene, motion):
    motion = motion | {"motion.duration": SECONDS}
    rows, told = run_live(case, find("", params).absolute(), scene, motion, PATIENT, SECONDS + 0.3)
    return rows[: np.searchsorted(rows.deadline, rows.deadline[0] + SECONDS * 1e9)], told


def _drag(rows):
    """Apparent damping and mass of the coupling: least squares of f = −c v + m ω² (x − centre) over a steady circle."""
    place = rows.position[:, :2] - rows.position[:, :2].mean(axis=0)
    known = np.stack([-rows.velocity[:, :2].ravel(), (TURNING**2 * place).ravel()], axis=1)
    (damping, mass), *_ = np.linalg.lstsq(known, rows.force_coupling[:, :2].ravel(), rcond=None)
    return float(damping), float(mass)


def _jump(rows):
    """Largest change of the coupling's force within a millisecond [N]."""
    late = max(1, round(1e6 / (rows.deadline[1] - rows.deadline[0])))
    return float(np.abs(rows.force_coupling[late:, :2] - rows.force_coupling[:-late, :2]).max())


def _show(found, how):
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{how}; stiffness and drag as the hand feels them, energies the largest on the way")
    heads = (
        "method",
        "delay ms",
        "jitter ms",
        "loss",
        "rate Hz",
        "stiffness N/m",
        "tool error mm",
        "drag N s/m",
        "mass kg",
        "ratio 1/s",
        "given J",
        "supplied J",
        "jump N/ms",
    )
    for head in heads:
        table.add_column(head, justify="right")
    for case, one in found.items():
        network = case.delay * 1e3, case.jitter * 1e3, case.loss, case.rate
        felt = one.stiffness, one.tool_error * 1e3, one.damping, one.mass, one.impedance_ratio
        energies = one.given, one.supplied, one.jump
        felt = _shown(felt) if one.passive else ("active", *"––––")
        table.add_row(case.method, *_shown(network), *felt, *_shown(energies))
    Console(width=None if Console().is_terminal else 170).print(table)


def _shown(numbers):
    return [f"{number:.4g}" for number in numbers]
