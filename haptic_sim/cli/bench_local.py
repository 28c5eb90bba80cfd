# SPDX-License-Identifier: Apache-2.0
"""`haptic bench local`: what the tool in the servo is worth, in lock-step: stiffness, drag, mass, peg, nut, block."""

import json
from typing import Annotated, NamedTuple

import numpy as np
import typer
from scipy.signal import savgol_filter

from haptic_device.device import load_device
from haptic_device.parameter import read_operating_point
from haptic_device.share import find
from haptic_sim.cli.bench_exchange import CIRCLE, PATIENT, PRESS
from haptic_sim.cli.nodes import NODES
from haptic_sim.lockstep import Lockstep, Network
from haptic_sim.method import Coupling
from haptic_sim.method.registry import make
from haptic_sim.scene import load
from haptic_sim.simulation import Simulation
from haptic_sim.tool_port import port_of

SECONDS = 3.0
SMOOTHED = 0.1  # [s] of the polynomial that drag and mass are read from
DAMPING = 0.5  # [N s/m] B of the coupling
SHARE = 0.95  # of the stiffness 2 (b − B)/T that the device covers
FINE = 1e8  # counts per metre: what an encoder's step makes of a stiff spring is another matter (docs/passivity.md)
NETWORKS = {"1 kHz": (Network(1e-3, seed=1), 1000.0), "3 ms": (Network(3e-3, seed=1), 1000.0),
            "100 Hz": (Network(1e-3, seed=1), 100.0),
            "20 ms, 10 % lost": (Network(0.02, 0.0, 0.1, 1), 1000.0)}  # fmt: skip
GAINS = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
TASKS = ("wall", "corner", "peg_in_hole", "wrench_on_nut", "push_block")


class Felt(NamedTuple):
    """Stiffness felt at the wall and of the coupling [N/m]; drag [N s/m] and mass [kg] in free space; energy given
    [J]; share of the time in which the servo's own tool was used."""

    stiffness: float
    coupling: float
    drag: float
    mass: float
    given: float
    local: float


def local(
    rate: Annotated[list[float] | None, typer.Option(help="Servo rate (Hz) [1000 4000 10000].")] = None,
    task: Annotated[list[str] | None, typer.Option(help="Scene of the comparison; may be repeated [all].")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """The tool in the servo: stiffness against drag for every method, and scenes against the synchronous reference."""
    felt = {(hertz, name): measure(hertz, name) for hertz in rate or (1000.0, 4000.0, 10000.0)
            for name in ("direct", "pspm", "local")}  # fmt: skip
    tasks = {(scene, name): compare(scene, *NETWORKS[name]) for scene in task or TASKS for name in NETWORKS}
    if as_json:
        rows = [{"rate": hertz, "method": name, **one._asdict()} for (hertz, name), one in felt.items()]
        done = [{"scene": name, "network": network, **one} for (name, network), one in tasks.items()]
        typer.echo(json.dumps({"felt": rows, "tasks": done}))
        return
    typer.echo("servo Hz  method  coupling N/m  felt N/m  share  drag N s/m  mass kg  ratio 1/s  given mJ  local")
    for (hertz, name), one in felt.items():
        typer.echo(f"{hertz:8.0f}  {name:6} {one.coupling:13.0f} {one.stiffness:9.0f}"
                   f" {one.stiffness / one.coupling:6.3f} {one.drag:11.4f} {one.mass:8.4f}"
                   f" {one.stiffness / max(1e-3, abs(one.drag)):10.3g}"
                   f" {one.given * 1e3:9.3f} {one.local:6.3f}")  # fmt: skip
    typer.echo(
        "\nscene          network            tool RMS mm  force RMS diff  mean force  rough    ref  fallbacks  local"
        "  given mJ"
    )
    for (scene, name), one in tasks.items():
        typer.echo(f"{scene:14} {name:18} {one['tool'] * 1e3:11.4f} {one['force']:14.2%}"
                   f" {one['mean']:11.3f} {one['rough']:6.2%} {one['smooth']:6.2%}"
                   f" {one['fallbacks']:9d} {one['local']:7.3f} {one['given'] * 1e3:9.3f}")  # fmt: skip


def measure(rate: float, method: str) -> Felt:
    """Figures of one exchange method at a servo rate, the coupling as stiff as the device covers."""
    stiffness = SHARE * 2.0 * (3.0 - DAMPING) * rate
    given = {"servo.rate": rate, "coupling.stiffness": stiffness, "coupling.damping": DAMPING}
    pressed, system = run("wall", method, *NETWORKS["1 kHz"], given, PRESS, fine=True)
    held = pressed[int(0.55 * len(pressed)) : int(0.68 * len(pressed))]
    led, free = run("free_space", method, *NETWORKS["1 kHz"], given, CIRCLE, fine=True)
    felt = float(held.force_coupling[:, 0].mean() / (0.01 - held.position[:, 0].mean()))
    return Felt(
        felt, stiffness, *drag(led), max(largest(system), largest(free)), float(led.local[len(led) // 2 :].mean())
    )


def compare(scene: str, network: Network, rate: float) -> dict[str, float]:
    """A scene's own motion with `local` against the synchronous solution: the same handle, world and tool in one step.

    tool: RMS of the way between the two [m]; force: RMS of the difference at the handle, of the force's own; mean: of
    the forces' magnitudes, as a ratio; rough: RMS of the force above 100 Hz, of its own; smooth: of the reference's.
    """
    motion = {f"motion.{key}": value for key, value in load(scene).motion.items()}
    rows, system = run(scene, "local", network, rate, {}, motion, float(motion["motion.duration"]))
    place, force = synchronous(scene, rows, system)
    late = slice(len(rows) // 4, None)
    here, there = rows.force_coupling[late, :2], force[late, :2]
    return {
        "tool": rms((rows.coupling_position - place)[late, :2]), "force": rms(here - there) / max(1e-9, rms(there)),
        "mean": float(np.hypot(*here.T).mean() / max(1e-9, np.hypot(*there.T).mean())),
        "rough": roughness(here, 1e9 / system.period), "smooth": roughness(there, 1e9 / system.period),
        "fallbacks": int(rows.local_fallbacks[-1]), "local": float(rows.local[late].mean()), "given": largest(system),
    }  # fmt: skip


def synchronous(scene, rows, system):
    """Place of the tool and force on the handle (n, 3) where the world is stepped with every tick of the servo."""
    world = make("partitioned", load(scene), system.period * 1e-9)
    world.couple(Coupling(*(float(system.gains[name]) for name in GAINS)))
    place, force = np.zeros((2, len(rows), 3))
    for k, (position, velocity) in enumerate(zip(rows.position.tolist(), rows.velocity.tolist(), strict=True)):
        world.step(position, velocity)
        place[k], force[k] = world.position, world.force_on_tool
    return place, -force


def run(scene, method, network, exchange_rate, given, motion, seconds=SECONDS, fine=False):
    """Rows of a motion in a scene or one by name, in lock-step at the demo's operating point, and the system."""
    stated = read_operating_point(find("", "demo"), NODES)
    values = {node: {one.name: one.default for one in NODES[node]} | stated.get(node, {}) for node in NODES}
    driver = values["haptic_driver"] | PATIENT | {"exchange.method": method, "exchange.rate": exchange_rate} | given
    device = load_device(driver["device"])
    if fine:
        axes = tuple(axis.model_copy(update={"counts_per_unit": FINE}) for axis in device.axes)
        device = device.model_copy(update={"axes": axes})
    loopback = values["haptic_loopback"] | motion | {"motion.duration": seconds}
    scene = load(scene) if isinstance(scene, str) else scene
    system = Lockstep(device, driver, loopback, Simulation(scene, None, 0.5, port=port_of(method)), network)
    return system.run(seconds), system


def largest(system) -> float:
    """Energy given to the operator [J] as the truth has it at the end."""
    return float(system.plant_memory["energy_given"][0])


def drag(rows) -> tuple[float, float]:
    """Apparent damping [N s/m] and mass [kg] of the coupling in free motion: least squares of f = −c v − m a."""
    period = float(rows.deadline[1] - rows.deadline[0]) * 1e-9
    width, steady = round(SMOOTHED / period) | 1, slice(int(0.25 * len(rows)), int(0.75 * len(rows)))
    known, force = [], []
    for axis in (0, 1):
        rate, bend = (savgol_filter(rows.position[:, axis], width, 3, k, period)[steady] for k in (1, 2))
        known.append(np.stack([-rate, -bend], axis=1))
        force.append(savgol_filter(rows.force_coupling[:, axis], width, 3)[steady])
    (damping, mass), *_ = np.linalg.lstsq(np.concatenate(known), np.concatenate(force), rcond=None)
    return float(damping), float(mass)


def rms(numbers) -> float:
    """Root of the mean of Σ squares over the rows."""
    return float(np.sqrt(np.mean(np.sum(np.square(numbers), axis=-1))))


def roughness(force, rate: float) -> float:
    """RMS of a force (n, axes) above 100 Hz in that of the whole."""
    spectrum = np.fft.rfft(force * np.hanning(len(force))[:, None], axis=0)
    above = np.fft.rfftfreq(len(force), 1.0 / rate) > 100.0
    return float(np.sqrt(np.sum(np.abs(spectrum[above]) ** 2) / np.sum(np.abs(spectrum) ** 2)))
