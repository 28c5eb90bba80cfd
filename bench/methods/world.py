# SPDX-License-Identifier: Apache-2.0
"""What can be measured: one of the methods, or a peer, on a scene; by name, imported only when it is used."""

import importlib
import importlib.metadata

import numpy as np

from haptic_sim.lockstep.rollout import LedWorld
from haptic_sim.method_registry import METHODS
from haptic_sim.method_registry import make as make_method
from haptic_sim.reduction import reduce_scene
from haptic_sim.scene.language import Scene

PEERS = {
    "pymunk": "bench.methods.peer_pymunk:World",
    "box2d": "bench.methods.peer_box2d:World",
    "mujoco_rk4": "bench.methods.peer_mujoco:RungeKutta",
    "mujoco_implicit": "bench.methods.peer_mujoco:Implicit",
}
OURS = tuple(METHODS)
NAMES = (*OURS, *PEERS)
_TITLES = {  # of a peer: name and package of its library, and what of it is meant
    "pymunk": ("pymunk", "pymunk", ""),
    "box2d": ("Box2D 3", "pyb2d3", ""),
    "mujoco_rk4": ("MuJoCo", "mujoco", " RK4"),
    "mujoco_implicit": ("MuJoCo", "mujoco", " implicit"),
}


class Impossible(Exception):
    """A scene that this one cannot model; the message says what of it."""


def make(name: str, scene: Scene, sub_step: float) -> LedWorld:
    """The world called `name`; Impossible if it cannot model the scene, ValueError if there is none of that name."""
    if name in PEERS:
        return _peer(name)(scene, sub_step)
    if name not in METHODS:
        raise ValueError(f"method is {name!r}; it must be one of {', '.join(NAMES)}")
    try:
        return make_method(name, reduce_scene(scene), sub_step)
    except ValueError as refusal:
        raise Impossible(str(refusal)) from None


def missing(name: str) -> str | None:
    """Sentence if the package of a peer is not installed."""
    try:
        if name in PEERS:
            _peer(name)
    except ModuleNotFoundError as error:
        return (
            f"{name} is left out: package {error.name} is not installed; pip install '.[bench]' in the clone brings it"
        )
    return None


def version(name: str) -> str:
    """Name of a peer's library and its version, or that of its bindings; of a method its name."""
    if name not in PEERS:
        return name
    library, package, _ = _TITLES[name]
    try:
        found = importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:  # a table of runs made elsewhere
        return library
    return f"{library} {found}" if package == library.casefold() else f"{library} of {package} {found}"


def label(name: str) -> str:
    """Method or peer without a version, which stored runs do not tell."""
    library, _, variant = _TITLES.get(name, (name, "", ""))
    return library + variant


def title(name: str) -> str:
    """Heading of a method or peer in a table."""
    return version(name) + _TITLES[name][2] if name in PEERS else name


def between(path: np.ndarray, count: int) -> np.ndarray:
    """The hand's path with `count` − 1 rows put in evenly between each two."""
    rows = np.arange(count * (len(path) - 1) + 1) / count
    low = np.minimum(rows.astype(int), len(path) - 2)
    part = (rows - low)[:, None]
    return path[low] * (1.0 - part) + path[low + 1] * part


def _peer(name):
    module, kind = PEERS[name].split(":")
    return getattr(importlib.import_module(module), kind)
