# SPDX-License-Identifier: Apache-2.0
"""Worlds of many bodies in the scene language, of any number of them, with the hand that goes with each.

Hand size throughout: pieces of some mm and grams, a tool of 0.1 kg. `pyramid` and `joint_grid` are after the loads of
those names in Box2D's benchmark, a metre there being 10 mm here: a pyramid of square boxes, discs pinned in a square.
"""

import math
from typing import NamedTuple

import numpy as np

from haptic_sim.rollout import hand, way
from haptic_sim.scene.geometry import framed, turned
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL

MATERIAL = {"material": "stone"}
BLOCK, PITCH, LINK = 0.005, 0.01, 0.005  # m


class Load(NamedTuple):
    """A world to be simulated for `seconds`; `still` are bodies that stay where they are if all is right."""

    scene: Scene
    seconds: float
    still: tuple[str, ...] = ()

    def path(self) -> np.ndarray:
        """Positions and velocities (n + 1, 6) of the handle, once a millisecond."""
        return way(hand(self.scene), np.arange(round(self.seconds * 1e3) + 1) * 1e-3)


def row(count: int, seconds: float) -> Load:
    """Blocks at rest side by side on a floor, a tool that nobody meets above them."""
    blocks = [_block(k, (1.2 * BLOCK * (k - 0.5 * (count - 1)), 0.5 * BLOCK), BLOCK) for k in range(count)]
    return _untouched("row", [_plane("floor", (0.0, 1.0)), *blocks], 0.04, seconds)


def pyramid(count: int, seconds: float) -> Load:
    """Square boxes of 10 mm on each other, one less in each layer, as many layers as `count` allows."""
    base = int(math.sqrt(2.0 * count + 0.25) - 0.5)
    places = [
        (1.25 * PITCH * (k - 0.5 * (base - 1 - layer)), PITCH * (layer + 0.5))
        for layer in range(base)
        for k in range(base - layer)
    ]
    boxes = [_block(k, place, PITCH) for k, place in enumerate(places)]
    return _untouched("pyramid", [_plane("floor", (0.0, 1.0)), *boxes], PITCH * base + 0.04, seconds)


def _untouched(name, bodies, height, seconds):
    still = tuple(body["name"] for body in bodies[1:])
    motion = {"name": "circle", "radius": 0.005, "turns": 2.0 * seconds, "duration": seconds}
    return Load(_scene(name, bodies, _tool((0.0, height)), motion), seconds, still)


def heap(count: int, seconds: float) -> Load:
    """Discs and boxes dropped between two walls, a round tool stirring in them twice a second."""
    columns, start = math.ceil(1.6 * math.sqrt(count)) + 1, (0.012, 0.024)
    cells = _cells(3 * count + 30, columns)
    places = [cell for cell in cells if math.dist(cell, start) > 0.012][:count]
    pieces = [
        _piece(k, place, {"circle": {"radius": 0.0045}} if k % 2 else {"box": {"size": [0.007, 0.007]}})
        for k, place in enumerate(places)
    ]
    motion = {"name": "circle", "radius": start[0], "turns": 2.0 * seconds, "duration": seconds}
    return Load(_scene("heap", _trough(0.5 * PITCH * columns) + pieces, _tool(start), motion), seconds)


def chain(count: int, seconds: float) -> Load:
    """Links of 5 mm that hang on pins from the world; the tool on the lowest pin leads it aside and up, and back."""
    links = [_piece(k, (0.0, -LINK * (k + 0.5)), {"box": {"size": [0.002, 0.9 * LINK]}}, []) for k in range(count)]
    names = ["world", *(link["name"] for link in links), TOOL]
    pins = [_pin(a, b, (0.0, -LINK * k)) for k, (a, b) in enumerate(zip(names, names[1:], strict=False))]
    end = -LINK * count
    motion = {"name": "press_wall", "target": [0.02, end + 0.01, 0.0], "duration": seconds}
    return Load(_scene("chain", links, _tool((0.0, end)), motion, pins), seconds)


def joint_grid(count: int, seconds: float) -> Load:
    """Discs pinned to all their neighbours, the uppermost to the world: it cannot move. The tool pulls at a corner."""
    side = int(math.sqrt(count))
    discs = [
        _piece(side * i + j, (PITCH * j, -PITCH * (i + 0.5)), {"circle": {"radius": 0.004}}, [])
        for i in range(side)
        for j in range(side)
    ]
    names = [disc["name"] for disc in discs]
    pins = [
        _pin(names[k - 1], names[k], (PITCH * (k % side - 0.5), discs[k]["pose"][1]))
        for k in range(side * side)
        if k % side
    ]
    pins += [
        _pin("world" if k < side else names[k - side], names[k], (PITCH * (k % side), -PITCH * (k // side)))
        for k in range(side * side)
    ]
    corner = (PITCH * (side - 1), -PITCH * side)
    motion = {"name": "press_wall", "target": [corner[0] + 0.003, corner[1] + 0.001, 0.0], "duration": seconds}
    scene = _scene("joint_grid", discs, _tool(corner), motion, [*pins, _pin(names[-1], TOOL, corner)])
    return Load(scene, seconds, tuple(names))


def _cells(count, columns):
    return [(PITCH * (k % columns - 0.5 * (columns - 1)), PITCH * (k // columns + 0.55)) for k in range(count)]


def _scene(name, bodies, tool, motion, joints=()):
    start = list(tool["pose"])
    return Scene.model_validate(
        {
            "name": name,
            "gravity": [0.0, -9.81],
            "materials": {"stone": {"friction": 0.5}},
            "bodies": bodies,
            "joints": list(joints),
            "tool": tool,
            "motion": {"start": start, "target": start} | motion,
        }
    )


def _plane(name, normal, point=(0.0, 0.0)):
    shape = {"half_plane": {"point": list(point), "normal": list(normal)}}
    return {"name": name, "fixed": True, **MATERIAL, "shapes": [shape]}


def _trough(half):
    return [
        _plane("floor", (0.0, 1.0)),
        _plane("left", (1.0, 0.0), (-half, 0.0)),
        _plane("right", (-1.0, 0.0), (half, 0.0)),
    ]


def _piece(k, place, shape, layers=(0,)):
    return {
        "name": f"piece_{k}",
        "mass": 0.002,
        **MATERIAL,
        "pose": [*place, 0.0],
        "layers": list(layers),
        "shapes": [shape],
    }


def _block(k, place, size):
    return _piece(k, place, {"box": {"size": [size, size]}})


def _tool(place):
    return {"mass": 0.1, **MATERIAL, "pose": [*place, 0.0], "shapes": [{"circle": {"radius": 0.006}}]}


def _pin(a, b, place):
    return {"type": "pin", "bodies": [a, b], "at": list(place)}


def pins_open(scene: Scene, pose) -> float:
    """The way [m] by which the two sides of the worst pin are apart, where `pose` (body → pose) says they are."""
    solids = {body.name: body for body in scene.bodies} | {TOOL: scene.tool}
    gaps = []
    for joint in scene.joints:
        a, b = (
            turned(framed(joint.at, solids[name].pose), pose(name)) if name in solids else joint.at
            for name in joint.bodies
        )
        gaps.append(math.dist(a, b))
    return max(gaps, default=0.0)
