# SPDX-License-Identifier: Apache-2.0
"""Runs of `python -m bench local` in lock-step or on live nodes, and what the hand feels in them."""

from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from bench.exchange import motion
from bench.reference import peg
from haptic_device.control.tool_contacts import LEAVING
from haptic_sim.lockstep.lockstep import Network
from haptic_sim.method_registry import make
from haptic_sim.protocol import Coupling, held
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene, load

SMOOTHED = 0.1  # [s] of the polynomial that drag and mass are read from
DAMPING = 0.5  # [N s/m] B of the coupling
SHARE = 0.95  # of the stiffness 2 (b − B)/T that the device covers
FINE = {"counts_per_unit": 1e8}  # what an encoder's step makes of a stiff spring is docs/theory/passivity.md
SMOOTH = FINE | {"coulomb": 0.0}  # where the device's dry friction would hold the handle
NETWORKS = {
    "1 kHz": (Network(1e-3, seed=1), 1000.0),
    "3 ms": (Network(3e-3, seed=1), 1000.0),
    "100 Hz": (Network(1e-3, seed=1), 100.0),
    "20 ms, 10 % lost": (Network(0.02, 0.0, 0.1, 1), 1000.0),
}
GAINS = ("stiffness", "damping", "rotational_stiffness", "rotational_damping")
SOFT = 1e-5  # [m/N] of the contacts in Fig. 5; at rest one is a spring of LEAVING times its inverse
HAND = 1.0  # [N m/rad] of the hand, behind which a rotation gain stands
PULLS = (5e-5, 4.5e-4)  # [m] of the hand beyond the free play
PULLING = 2.0  # [s]
STEADY = 0.1  # RMS of a force about its mean, of that, below which it is a steady one


class Felt(NamedTuple):
    """Stiffness felt at the wall and of the coupling [N/m]; drag [N s/m] and mass [kg] in free space; energy given
    [J]; share of the time in which the servo's own tool was used, from its first use on; median age of the tool sample
    [s]; sets of local contacts taken; ticks missed; RMS of the force at the wall about its mean, of that."""

    stiffness: float
    coupling: float
    drag: float
    mass: float
    given: float
    local: float
    age: float
    sets: int
    missed: int = 0
    swing: float = 0.0

    @property
    def steady(self) -> bool:
        """Whether the handle rested in the wall: force over depth is no stiffness where it shakes."""
        return self.swing < STEADY


def measure(rate: float, method: str, live: bool = False) -> Felt:
    """Figures of one exchange method at a servo rate [Hz], with a coupling as stiff as the device covers.

    ValueError with the fault's name if one latched on live nodes.
    """
    stiffness = SHARE * 2.0 * (3.0 - DAMPING) * rate
    given = {"servo.rate": rate, "coupling.stiffness": stiffness, "coupling.damping": DAMPING}
    pressed, led = (
        _run(scene, method, "1 kHz", given, hand, FINE, live=live)
        for scene, hand in (("wall", motion.PRESS), ("free_space", motion.CIRCLE))
    )
    force = motion.pressing(pressed.rows).force_coupling[:, 0]
    acted = np.concatenate([rows.local[np.argmax(rows.local > 0.0) :] for rows in (pressed.rows, led.rows)])
    return Felt(
        motion.stiffness(pressed.rows),
        stiffness,
        *drag(led.rows),
        max(pressed.given, led.given),
        float(acted.mean()),
        float(np.median(led.rows.tool_age)),
        pressed.sets + led.sets,
        sum(int(rows.missed[-1] - rows.missed[0]) for rows in (pressed.rows, led.rows)),
        float(force.std() / abs(force.mean())),
    )


def _run(scene, method, network, *given, live, **named):
    """A motion over the network of this name; live it is what it is. ValueError with the name of a fault."""
    between, rate = NETWORKS[network]
    ran = motion.run(scene, method, None if live else between, rate, *given, live=live, **named)
    if ran.faults:
        raise ValueError(f"{method}, {ran.faults[0]}")
    return ran


def compare(
    scene: str | Scene, network: str, live: bool = False, axis: dict | None = None, params: str = "demo"
) -> dict[str, float]:
    """A scene's own motion with `local` against the synchronous solution: the same handle, world and tool in one step.

    tool: RMS of the way between the two [m]; force: RMS of the difference at the handle, of the force's own; mean: of
    the forces' magnitudes, as a ratio; rough: RMS of the force above 100 Hz, of its own; smooth: of the reference's.
    network: one of NETWORKS; axis: what the device's axes have otherwise; params: operating point.
    """
    scene = load(scene) if isinstance(scene, str) else scene
    hand = {f"motion.{key}": value for key, value in scene.motion.items()}
    seconds, driver = float(hand["motion.duration"]), motion.operating_point(params)["haptic_driver"]
    soon = {name: driver[name] for name in motion.PATIENT} if live else {}  # the tool is held before the motion begins
    ran = _run(scene, "local", network, soon, hand, axis, seconds, live=live, params=params)
    rows = ran.rows
    period = float(np.median(np.diff(rows.deadline))) * 1e-9
    place, force = synchronous(scene, rows, period, driver)
    late = slice(len(rows) // 4, None)
    here, there = rows.force_coupling[late, :2], force[late, :2]
    return {
        "tool": rms((rows.coupling_position - place)[late, :2]),
        "force": rms(here - there) / max(1e-9, rms(there)),
        "mean": float(np.hypot(*here.T).mean() / max(1e-9, np.hypot(*there.T).mean())),
        "rough": roughness(here, 1.0 / period),
        "smooth": roughness(there, 1.0 / period),
        "fallbacks": int(rows.local_fallbacks[-1]),
        "local": float(rows.local[late].mean()),
        "given": ran.given,
        "age": float(np.median(rows.tool_age)),
    }


def insertion(deep: float, gain: float, live: bool = False) -> tuple[float, float]:
    """Stiffness [N/m] of a peg's handle at this insertion [m] and rotation gain [N m/rad]: felt, and by theory.

    A line through two pulls, each settled; they are held in one run.
    """
    play, behind = peg.free_play(deep, 1e-6), peg.behind_coupling(gain, HAND)
    near, far = ((play + pull, peg.HEIGHT, 0.0) for pull in PULLS)
    coupling = {"stiffness": peg.COUPLING, "damping": 1.0, "rotational_stiffness": gain, "rotational_damping": 0.002}
    given = {f"coupling.{name}": value for name, value in coupling.items()} | {"local.compliance": SOFT}
    hand = {"motion.name": "press_wall", "motion.start": near, "motion.target": far, "hand.rotational_stiffness": HAND}
    rows = _run(peg.peg(deep, 1e-6), "local", "1 kHz", given, hand, SMOOTH, PULLING, live=live, after=1.3).rows
    rows = rows[np.argmax(rows.engage >= 1.0) :]  # the motion begins with it
    (x1, f1), (x0, f0) = (_held(rows[int(4000.0 * begin) :][:1000]) for begin in (0.55 * PULLING, PULLING + 0.4))
    stiffness = peg.apparent_stiffness(deep, behind, LEAVING / SOFT)
    return (f1 - f0) / (x1 - x0), peg.behind_coupling(stiffness)


def _held(rows):
    """Where the handle rests [m] and what it pulls with [N]."""
    if not rows.local.all():
        raise ValueError("the servo's own tool was not in use")
    return float(rows.position[:, 0].mean()), float(-rows.force_coupling[:, 0].mean())


def synchronous(scene, rows, period: float, driver: dict):
    """Place of the tool and force on the handle (n, 3) where the world is stepped with every tick of the servo.

    It begins when the simulation's own does, with the first tool sample.
    """
    world = make("partitioned", reduce_scene(scene), period)
    world.couple(Coupling(*(float(driver[f"coupling.{name}"]) for name in GAINS)))
    place, force = np.zeros((2, len(rows), 3))
    for k, (position, velocity) in enumerate(zip(rows.position.tolist(), rows.velocity.tolist(), strict=True)):
        if rows.tool_age[k] >= 0.0:
            world.step(held(position, velocity), 1)
        place[k], force[k] = world.position, world.force_on_tool
    return place, -force


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
