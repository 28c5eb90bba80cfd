# SPDX-License-Identifier: Apache-2.0
"""One motion of the hand in a scene, in lock-step or on running nodes."""

import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from haptic_device.config.description import load_device
from haptic_device.config.files import find
from haptic_device.config.parameter_files import read_operating_point
from haptic_device.config.parameter_types import defaults
from haptic_device.recording import load as load_recording
from haptic_display.cli.demo import play
from haptic_display.run.report.conditions import period
from haptic_display.run.report.run import Run
from haptic_display.run.report.summary import energy_to_operator, engaged_rows, faults, given_to_tool
from haptic_display.run.system import Order, Relay
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.lockstep.lockstep import Lockstep
from haptic_sim.node.parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import load

SECONDS = 3.0
PATIENT = {"exchange.hold": 0.5, "exchange.fade": 0.5}  # a study of long delays does not let the tool go
PRESS = {"motion.name": "press_wall", "motion.start": (0.03, 0.0, 0.0), "motion.target": (0.005, 0.0, 0.0)}
CIRCLE = {"motion.name": "circle", "motion.start": (0.0, 0.0, 0.0), "motion.radius": 0.03, "motion.turns": 3.0}
WORLD = {"max_catch_up": 0.5}  # of haptic_simulation: it may be late and still makes up for it


class Ran(NamedTuple):
    """Rows of the ticks; mean distance of the tool from the handle [m]; largest energy given to the operator and
    supplied to the tool [J]; sets of local contacts taken; names of faults that latched."""

    rows: np.recarray
    error: float
    given: float
    supplied: float
    sets: int
    faults: tuple[str, ...] = ()


def run(
    scene, method, network, rate, given, motion, axis=None, seconds=SECONDS, live=False, after=0.0, params="demo"
) -> Ran:
    """A motion in a scene, or in one by name, and some time after it [s], at an operating point.

    rate: handle samples a second; given: parameters of the driver; axis: what the device's axes have otherwise.
    """
    scene = load(scene) if isinstance(scene, str) else scene
    device = load_device(operating_point(params)["haptic_driver"]["device"])
    device = device.model_copy(update={"axes": tuple(one.model_copy(update=axis or {}) for one in device.axes)})
    driver = PATIENT | {"exchange.rate": rate} | given
    hand = motion | {"motion.duration": seconds}
    made = _live if live else _in_lockstep
    return made(scene, method, network, device, driver, hand, seconds + after, params)


def operating_point(params: str = "demo") -> dict[str, dict]:
    """Values of all nodes' parameters at an operating point."""
    stated = read_operating_point(find("", params), NODES)
    return {node: defaults(NODES[node]) | stated.get(node, {}) for node in NODES}


def stiffness(rows) -> float:
    """What a rigid wall at 10 mm is felt as while the hand of `PRESS` rests in it [N/m]."""
    held = pressing(rows)
    return float(held.force_coupling[:, 0].mean() / (0.01 - held.position[:, 0].mean()))


def pressing(rows) -> np.recarray:
    """Rows in which the hand of `PRESS` rests in the wall."""
    return rows[int(0.55 * len(rows)) : int(0.68 * len(rows))]


def _in_lockstep(scene, method, network, device, driver, hand, seconds, params):
    values = operating_point(params)
    simulated = values["haptic_simulation"] | WORLD | {"exchange.method": method}
    simulation = Simulation.by_parameters(reduce_scene(scene, simulated["method"]), simulated)
    driver = values["haptic_driver"] | driver | {"exchange.method": method}
    system = Lockstep(device, driver, values["haptic_loopback"] | hand, simulation, network)
    rows, errors, given, supplied = [], [], 0.0, 0.0
    for _ in range(round(seconds * 1000)):
        rows.append(system.run(1e-3))
        errors.append(np.hypot(*(rows[-1].position[-1] - simulation.method.position)[:2]))
        given = max(given, float(system.plant_memory["energy_given"][0]))
        supplied = max(supplied, simulation.ledger.supplied)
    middle = errors[len(errors) // 5 : 4 * len(errors) // 5]
    sets = int(system.memory["virtual_tool"]["contacts"]["number"][0])
    return Ran(np.concatenate(rows).view(np.recarray), float(np.mean(middle)), given, supplied, sets)


def _live(scene, method, network, device, driver, hand, seconds, params):
    """The nodes as processes, behind a relay if there is a network; rows from engaging on, from the recording."""
    print(f"live: {method}, {scene.name}", file=sys.stderr)
    with tempfile.TemporaryDirectory(prefix="haptic_") as folder:
        world, described = (_written(Path(folder) / name, one) for name, one in (("scene", scene), ("device", device)))
        given = {
            "haptic_driver": {**driver, "device": described},
            "haptic_loopback": {**hand, "device": described},
            "haptic_simulation": WORLD,
        }
        relay = Relay(network.delay, network.jitter, network.loss) if network else None
        stated, out = find("", params).absolute(), Path(folder) / "run"
        play(Order(world, seconds + 0.3, out, method, None, stated, relay, given))
        recording = load_recording(out / "bag")
        rows = engaged_rows(recording.trace)
        rows = rows[: np.searchsorted(rows["deadline"], rows["deadline"][0] + seconds * 1e9)]
        most, ran = max(energy_to_operator(recording, rows), default=0.0), Run(recording, scene.name)
        sets = int(recording.last_values("haptic_driver").get("local_sets", 0))
    given, supplied, fell = max(0.0, float(most)), given_to_tool(ran), tuple(faults(ran))
    return Ran(rows.view(np.recarray), _tool_error(rows), given, supplied, sets, fell)


def _tool_error(rows):
    """Of each tool sample against the handle half of its age before."""
    known = np.flatnonzero((rows["tool_age"] >= 0.0) & (np.arange(len(rows)) > 0.2 * len(rows)))
    then = known - np.round(0.5 * rows["tool_age"][known] / period(rows)).astype(int)
    apart = rows["tool_position"][known] - rows["position"][np.maximum(0, then)]
    return float(np.hypot(apart[:, 0], apart[:, 1]).mean())


def _written(path, described) -> str:
    path = path.with_suffix(".yaml")
    path.write_text(yaml.safe_dump(described.model_dump(mode="json", by_alias=True, exclude_defaults=True)))
    return str(path)
