# SPDX-License-Identifier: Apache-2.0
"""What can be measured: one of the methods, or a peer, on a scene; by name, imported only when it is used."""

import importlib

import numpy as np

from haptic_sim.method_registry import METHODS
from haptic_sim.method_registry import make as make_method
from haptic_sim.reduction import reduce_scene
from haptic_sim.rollout import LedWorld
from haptic_sim.scene.language import Scene

PEERS = {
    "pymunk": "bench.methods.peer_pymunk:World",
    "box2d": "bench.methods.peer_box2d:World",
    "mujoco_rk4": "bench.methods.peer_mujoco:RungeKutta",
    "mujoco_implicit": "bench.methods.peer_mujoco:Implicit",
}
OURS = tuple(METHODS)
NAMES = (*OURS, *PEERS)
PACKAGES = {"Box2D": "box2d", "mujoco": "mujoco", "pymunk": "pymunk"}


class Impossible(Exception):
    """A scene that this one cannot model; the message says what of it."""


def make(name: str, scene: Scene, sub_step: float, many: bool = False) -> LedWorld:
    """The world called `name`; a peer is set up for `many` bodies that rest.

    Impossible if it cannot model the scene; ValueError if there is none of that name.
    """
    if name in PEERS:
        return _peer(name)(scene, sub_step, many)
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
        package = PACKAGES.get(error.name, error.name)
        return f"{name} is left out: package {package} is not installed; pip install '.[bench]' in the clone brings it"
    return None


def version(name: str) -> str:
    """Name and version of a peer's library; of a method its name."""
    return importlib.import_module(PEERS[name].split(":")[0]).VERSION if name in PEERS else name


def between(path: np.ndarray, count: int) -> np.ndarray:
    """The hand's path with `count` − 1 rows put in evenly between each two."""
    rows = np.arange(count * (len(path) - 1) + 1) / count
    low = np.minimum(rows.astype(int), len(path) - 2)
    part = (rows - low)[:, None]
    return path[low] * (1.0 - part) + path[low + 1] * part


def _peer(name):
    module, kind = PEERS[name].split(":")
    return getattr(importlib.import_module(module), kind)
