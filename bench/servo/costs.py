# SPDX-License-Identifier: Apache-2.0
"""The cost model: what a tick, an exchange, a sub-step and a cell cost in processor time, and how each grows."""

import json
import time
from collections.abc import Callable
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np
import typer
import yaml

from bench.jobs import markdown
from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_device.control import controller_config, records
from haptic_device.realtime import servo_loop, tick_replay
from haptic_device.realtime.machine import cores
from haptic_device.theory.zwidth import Setup
from haptic_device.theory.zwidth_map import Request, draw_map
from haptic_display.run.lateness import values
from haptic_sim.exchange.port import port_of
from haptic_sim.exchange.simulation import HandleSample, Simulation
from haptic_sim.lockstep.rollout import EXCHANGE_NS, GAINS, Exchanged, hand, rollout, way
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load, parse

REPEATS = 7  # of which the fastest counts
EXCHANGES = 600  # of which the first third is not counted
SUB_STEPS = (1, 2, 4, 8)  # in a millisecond
BLOCKS = (1, 2, 4, 6, 8)
METHODS = ("partitioned", "impulse")
LED, TURNS, SHIPPED = ("peg_in_hole", "wall"), 3, 1.0
"""Scenes behind a port, led by their own motion; runs of each port in turn; J/s that the hand ships."""


class Cost(NamedTuple):
    """A straight line through measured points: `base` at zero and `slope` for one more [us]; `apart`: the largest
    distance of a point from it as a share of the point."""

    what: str
    grows_with: str
    base: float
    slope: float
    apart: float


class Behind(NamedTuple):
    """Median time of an exchange of 1 ms [us]: behind a port that minds no energy, behind one that does, and of the
    bare calls of `Space.step` in it, if it makes such."""

    scene: str
    method: str
    direct: float
    pspm: float
    bare: float | None


def main(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the table.")] = False,
) -> None:
    """What a tick, an exchange, a sub-step and a cell cost, and how each grows with axes, walls, blocks, contacts."""
    ports = [behind(scene, method)._asdict() for method in METHODS for scene in LED]
    shared = efficiency(2) if cores() > 1 else None
    found = {"costs": [one._asdict() for one in measure()], "ports": ports, "two_cores": shared}
    typer.echo(json.dumps(found) if as_json else table(found))


def table(found: dict) -> str:
    """As a table of Markdown, and a sentence on the cores."""
    costs = [
        [one["what"], one["base"], one["slope"], one["grows_with"], f"{100.0 * one['apart']:.1f} %"]
        for one in found["costs"]
    ]
    ports = [
        [f"{one['scene']}, {one['method']}", one["direct"], one["pspm"], one["pspm"] / one["direct"], one["bare"]]
        for one in found["ports"]
    ]
    shared = found["two_cores"]
    said = "one core only: no efficiency" if shared is None else f"two cores do {2.0 * shared:.2f} times the map of one"
    heads = ("what", "at none [us]", "for one more [us]", "", "off the line")
    behind = ("an exchange of", "`direct` [us]", "`pspm` [us]", "ratio", "bare steps [us]")
    return "\n\n".join([markdown(heads, costs), markdown(behind, ports), said])


def line(what: str, grows_with: str, counts, cost: Callable) -> Cost:
    """The line of least squares through the points; cost: count → [us]."""
    microseconds = [cost(count) for count in counts]
    slope, base = np.polyfit(counts, microseconds, 1)
    apart = np.max(np.abs(np.polyval((slope, base), counts) / np.array(microseconds) - 1.0))
    return Cost(what, grows_with, float(base), float(slope), float(apart))


def measure() -> list[Cost]:
    """All of them; about half a minute."""
    peg = {f"exchange of peg_in_hole, {method}": partial(_of_peg, method) for method in METHODS}
    stacks = {f"exchange of a stack, {method}": partial(_of_stack, method) for method in METHODS}
    return [
        line("tick", "axis", (1, 2, 3), lambda count: tick(axes=count)),
        line("tick", "wall", (0, 2, 4, 8), lambda count: tick(walls=count)),
        *(line(what, "sub-step", SUB_STEPS, cost) for what, cost in peg.items()),
        *(line(what, "block (2 contacts)", BLOCKS, cost) for what, cost in stacks.items()),
        line("Z-width map", "cell", (2000, 4000, 8000, 16000), lambda count: sweep(count, 1)[0]),
    ]


def _of_peg(method, count):
    return exchange(load("peg_in_hole"), method, 1e-3 / count)


def _of_stack(method, blocks):
    return exchange(stack(blocks), method, 0.25e-3)


def tick(axes: int = 3, walls: int = 4, ticks: int = 4000) -> float:
    """Processor time of a tick [us] in lock-step without a plant: a handle that turns slowly within all walls."""
    shipped = load_device("desktop")
    device = shipped.model_copy(update={"axes": shipped.axes[:axes]})
    angles = 2.0 * np.pi * np.arange(walls) / max(1, walls)
    normals = np.column_stack([np.cos(angles), np.sin(angles)]).ravel()
    around = {"wall.normals": tuple(normals), "wall.offsets": (-0.015,) * walls, "wall.stiffness": (500.0,) * walls}
    around |= {"wall.damping": (0.1,) * walls, "cancellation.ratio": 0.5, "engage.time": 0.01}
    around = {key: value for key, value in around.items() if axes > 1 or not key.startswith("wall")}
    settings = controller_config.settings_from(device, values(**around))
    turn = np.arange(ticks)[:, None] * 1e-3 + np.array([0.0, np.pi / 2.0, 0.0])
    counts = np.round(0.016 * np.cos(turn) / 5e-6) * (np.arange(3) < axes)
    return 1e6 * min(_run(settings, counts) for _ in range(REPEATS)) / ticks


def _run(settings, counts):
    memory, rows = np.zeros(1, records.STATE), np.zeros(len(counts), records.TRACE_ROW)
    arrays = [array.view(np.recarray) for array in (settings, memory, rows, np.zeros(1, servo_loop.TOOL))]
    began = time.thread_time()
    tick_replay.run_on_counts(*arrays, counts, 1_000_000_000, 0, 5000, 1)
    return time.thread_time() - began


def exchange(scene, method: str, sub_step: float) -> float:
    """Median processor time of an exchange at 1 kHz [us], sub-steps and answer, over the scene's suggested motion."""
    lead = hand(scene)
    path = np.zeros((EXCHANGES, 6))
    path[:, :3] = [lead(k * scene.motion["duration"] / EXCHANGES) for k in range(EXCHANGES)]
    spent = rollout(Exchanged(Simulation(reduce_scene(scene, method), sub_step), path[0]), path).spent
    return 1e6 * float(np.median(spent[EXCHANGES // 3 :]))


def behind(scene: str, method: str) -> Behind:
    """The scene led by its motion in real time, behind each port in turn."""
    spent, steps = {"direct": [], "pspm": []}, []
    for _ in range(TURNS):
        for port, times in spent.items():
            simulation = Simulation(reduce_scene(load(scene), method), port=port_of(port))
            times += _lead(simulation)
            if port == "direct" and method == "impulse":
                simulation.reset()
                timed = simulation.method.space = Timed(simulation.method.space)
                steps += _lead(simulation, timed)
    direct, pspm = (1e6 * float(np.median(times)) for times in spent.values())
    return Behind(scene, method, direct, pspm, 1e6 * float(np.median(steps)) if steps else None)


class Timed:
    """A space whose steps are timed: `spent` [s] since somebody set it to 0."""

    def __init__(self, space):
        self._space, self.spent = space, 0.0

    def step(self, h):
        """As the space's own."""
        began = time.thread_time()
        self._space.step(h)
        self.spent += time.thread_time() - began

    def __getattr__(self, name):
        return getattr(self._space, name)


def _lead(simulation, timed=None):
    """Time of each exchange [s], or of the steps in it."""
    lead, spent = hand(simulation.scene), []
    for k, row in enumerate(way(lead, np.arange(round(simulation.scene.motion["duration"] * 1e3)) * 1e-3).tolist()):
        told = HandleSample(k * EXCHANGE_NS, tuple(row[:3]), tuple(row[3:]), *GAINS, energy=SHIPPED * k * 1e-3)
        if timed is not None:
            timed.spent = 0.0
        began = time.thread_time()
        simulation.exchange(told)
        spent.append(time.thread_time() - began if timed is None else timed.spent)
    return spent


def stack(blocks: int):
    """The scene `stack` with another number of blocks: two contacts each, and those of the tool."""
    text = yaml.safe_load(find("scenes", "stack").read_text())
    del text["measure"], text["task"]
    floor, block = text["bodies"][0], text["bodies"][1]
    floor["shapes"][0]["half_plane"]["point"] = [0.0, -0.02 * blocks]
    places = [[0.0, -0.01 - 0.02 * k, 0.0] for k in range(blocks)]
    text["bodies"] = [floor] + [block | {"name": f"block_{k}", "pose": place} for k, place in enumerate(places)]
    return parse(text, "stack")


def sweep(cells: int, workers: int) -> tuple[float, float]:
    """Processor and wall time [us] of a Z-width map of so many cells."""
    rows = 40
    gains = np.linspace(10.0, 1200.0, cells // rows), np.linspace(-0.5, 1.0, rows)
    request = Request(Setup(0.1, 0.5, 1e-3, seconds=0.2), "none", *gains)
    found = []
    for _ in range(3):
        busy, began = time.process_time(), time.perf_counter()
        draw_map(request, workers)
        found.append((time.process_time() - busy, time.perf_counter() - began))
    return tuple(1e6 * min(column) for column in zip(*found, strict=True))


def efficiency(workers: int, cells: int = 16000) -> float:
    """Speed on so many cores over that many times the speed on one."""
    return sweep(cells, 1)[1] / (workers * sweep(cells, workers)[1])
