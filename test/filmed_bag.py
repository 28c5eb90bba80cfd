# SPDX-License-Identifier: Apache-2.0
"""A small bag with a scene: a disc that swings above a floor, with contacts, marks and the truth of the hand."""

import json
from pathlib import Path

import numpy as np
from bag_of_a_run import (
    AXES,
    BOOT_TO_EPOCH,
    DAMPING,
    STIFFNESS,
    TICKS_PER_EXCHANGE,
    cloud,
    diagnostics,
    joints,
    string,
    swing,
    write_bag,
)

from haptic_device.control.exchange_samples import TAIL
from haptic_device.recording.layouts import CLOUD, DIAGNOSTICS, JOINTS, STRING, CloudLayout
from haptic_sim.node.scene_publisher import CONTACT, state_names
from haptic_sim.scene.language import parse

EVERY = 64  # ticks between two pictures of the scene
SCENE = {
    "name": "swing",
    "description": "a disc above a floor",
    "tool": {"mass": 0.1, "shapes": [{"circle": {"radius": 0.005}}], "pose": [0.0, 0.0, 0.0]},
    "bodies": [
        {"name": "floor", "fixed": True, "shapes": [{"box": {"size": [0.1, 0.01]}}], "pose": [0.0, -0.02, 0.0]},
        {"name": "block", "mass": 0.2, "shapes": [{"box": {"size": [0.01, 0.01]}}], "pose": [0.03, 0.0, 0.0]},
    ],
}


def rows_of(ticks: int, contact: tuple[int, int] = (2000, 2400)) -> np.ndarray:
    """Trace rows of the handle's swing, in contact between these ticks."""
    rows = swing(ticks)
    rows["tool_contact"][slice(*contact)] = 1
    return rows


def film_bag(folder: Path, rows: np.ndarray, scene: dict | None = SCENE, marks=(), shown: bool = True) -> Path:
    """The rows as a bag. scene None: its description is missing. marks: (tick, text). shown: with scene/state."""
    messages = [("/haptic/scene", STRING, string(json.dumps(scene)), 1, _time(rows[0]))] if scene else []
    for start in range(0, len(rows), 80):
        part = rows[start : start + 80]
        messages.append(("/haptic/trace", CLOUD, cloud(part), start // 80 + 1, _time(part[-1])))
    for number, row in enumerate(rows[::TICKS_PER_EXCHANGE], 1):
        known = {"layout_version": 1, "stiffness": STIFFNESS, "damping": DAMPING}
        tail = [known.get(name, 0) for name in TAIL]
        for topic, port in (("handle", ""), ("tool", "tool_")):
            data = joints(AXES + TAIL, [*row[f"{port}position"], *tail], _time(row))
            messages.append((f"/haptic/{topic}", JOINTS, data, number, _time(row)))
        names, place = (*AXES, "energy_given", "time"), [*row["position"], -1e-3 * number, row["deadline"] * 1e-9]
        force = [*row["force_on_handle"], 0.0, 0.0]
        messages.append(
            ("/haptic/operator/state", JOINTS, joints(names, place, _time(row), effort=force), number, _time(row))
        )
    if shown:
        messages += _shown(rows, parse(scene or SCENE, "scene"))
    messages += [("/haptic/mark", STRING, string(text), n, _time(rows[at])) for n, (at, text) in enumerate(marks, 1)]
    said = diagnostics("haptic_simulation", {"scene": "swing", "method": "impulse"})
    messages.sort(key=lambda message: message[-1])
    return write_bag(folder, *messages, ("/diagnostics", DIAGNOSTICS, said, 1, _time(rows[-1])))


def _shown(rows, scene):
    names, layout = state_names(scene), CloudLayout(CONTACT, "haptic_map")
    for number, row in enumerate(rows[::EVERY], 1):
        x = row["position"][0]
        place = [*row["position"], x, 0.001, 0.0, 0.0, -0.02, 0.0, 0.03 + x, 0.0, 0.5, 2e-3 * number]
        touching = np.zeros(int(row["tool_contact"] > 0), CONTACT)
        touching["x"], touching["y"], touching["force_y"] = x, -0.004, 1.5
        yield "/haptic/scene/state", JOINTS, joints(names, place, _time(row)), number, _time(row)
        yield "/haptic/scene/contacts", CLOUD, bytes(layout.pack(_time(row), touching)), number, _time(row)


def _time(row) -> int:
    return int(row["deadline"]) + BOOT_TO_EPOCH
