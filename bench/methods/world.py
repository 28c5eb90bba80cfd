# SPDX-License-Identifier: Apache-2.0
"""What can be measured: one of the methods, or a peer, on a scene; by name, imported only when it is used."""

import importlib
from typing import Protocol

import numpy as np

from haptic_sim.method import Coupling, Planar
from haptic_sim.method.registry import METHODS
from haptic_sim.method.registry import make as make_method
from haptic_sim.scene import Scene

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


class World(Protocol):
    """A scene with a tool in it, led by a hand."""

    supplied: float
    """Energy [J] that the coupling has given to the tool since the start."""

    def couple(self, gains: Coupling) -> None:
        """Takes these gains."""

    def follow(self, path: np.ndarray, count: int) -> None:
        """`count` steps from each row of the hand's path (n, 6: position, velocity) evenly to the next."""

    def pose(self, body: str) -> Planar:
        """Pose of a body's frame."""

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy [J]. Whoever asks wants them after each `follow`: it may book from now on."""


def make(name: str, scene: Scene, sub_step: float) -> World:
    """The world called `name`. Impossible if it cannot model the scene; ValueError if there is none of that name."""
    if name in PEERS:
        return _peer(name)(scene, sub_step)
    if name not in METHODS:
        raise ValueError(f"method is {name!r}; it must be one of {', '.join(NAMES)}")
    try:
        return _Own(make_method(name, scene, sub_step))
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


class _Own:
    """A method of this project, its supply summed."""

    def __init__(self, method):
        self._method, self.supplied = method, 0.0
        self.couple, self.pose, self.energy = method.couple, method.pose, method.energy

    def follow(self, path, count):
        follow = getattr(self._method, "follow", None)
        if follow:
            self.supplied += follow(path, count).supplied
            return
        rows = [(tuple(row[:3]), tuple(row[3:])) for row in path.tolist()]
        for start, end in zip(rows, rows[1:], strict=False):
            self.supplied += self._method.travel(*start, *end, count).supplied
