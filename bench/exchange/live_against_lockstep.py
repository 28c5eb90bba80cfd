# SPDX-License-Identifier: Apache-2.0
"""Plays a recorded demo again in lock-step, with the delay measured in it, and prints how far the handles are apart."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from haptic_device import recording
from haptic_device.config_files import find
from haptic_device.control import enable_state
from haptic_device.description import load_device
from haptic_device.parameter_files import read_operating_point
from haptic_sim.exchange.simulation import Simulation
from haptic_sim.node_parameters import NODES
from haptic_sim.reduction import reduce_scene
from haptic_sim.replay.lockstep import Lockstep, Network
from haptic_sim.scene.language import load


def values_of(node, given, **more):
    """All parameter values of a node: defaults, the operating point's, and more."""
    return {parameter.name: parameter.default for parameter in NODES[node]} | given.get(node, {}) | more


def system(scene_name, params, delay, write_delay):
    """The lock-step twin of a demo."""
    scene, given = load(scene_name), read_operating_point(find("", params), NODES)
    motion = {f"motion.{key}": value for key, value in scene.motion.items()}
    driver, loopback = values_of("haptic_driver", given), values_of("haptic_loopback", given, **motion)
    simulated = values_of("haptic_simulation", given)
    simulation = Simulation.by_parameters(reduce_scene(scene, simulated["method"]), simulated)
    return Lockstep(load_device(driver["device"]), driver, loopback, simulation, Network(delay), write_delay)


def first_use_age(trace):
    """Median age [s] of a tool sample in the first tick that used it."""
    new = np.flatnonzero(np.diff(trace["tool_answered"]) > 0) + 1
    return float(np.median(trace["tool_age"][new]))


def main(
    run: Annotated[Path, typer.Argument(help="Folder of the demo's run.")],
    scene: Annotated[str, typer.Option(help="A name in config/scenes or a YAML file.")] = "peg_in_hole",
    params: Annotated[str, typer.Option(help="Operating point: a name in config or a YAML file.")] = "demo",
) -> None:
    """Plays a recorded demo again in lock-step and prints how far the handles are apart."""
    trace = recording.load(run / "bag").trace
    begun = int(np.argmax(trace["state"] == enable_state.ENGAGED))
    live = trace["position"][begun:]
    age, late = first_use_age(trace[begun:]), float(np.median(trace["lateness"][begun:]))
    twin = system(scene, params, age, late)
    rows = twin.run(1.0 + len(live) * twin.period * 1e-9)
    twin_begun = int(np.argmax(rows.state == enable_state.ENGAGED))
    count = min(len(live), len(rows) - twin_begun)
    elapsed = (trace["deadline"][begun : begun + count] - trace["deadline"][begun]) / twin.period
    apart = live[:count] - rows.position[twin_begun + np.minimum(elapsed.astype(int), count - 1)]
    rms = np.sqrt(np.mean(apart**2, axis=0))
    print(f"round trip {age * 1e3:.3f} ms, write {late * 1e6:.1f} us after the deadline, {count} ticks")
    print(f"handle apart, RMS: x {rms[0] * 1e3:.4f} mm, y {rms[1] * 1e3:.4f} mm, theta {rms[2]:.5f} rad")
