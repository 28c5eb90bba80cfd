# SPDX-License-Identifier: Apache-2.0
"""A scene and a device with something of each kind, and what becomes of them with one entry changed."""

import copy

SQUARE = [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]
TABLE = {"box": {"size": [1, 0.1], "center": [0, -0.05]}}
SCENE = {
    "name": "sample",
    "materials": {"steel": {"friction": 0.2}},
    "bodies": [
        {"name": "table", "fixed": True, "material": "steel", "shapes": [TABLE]},
        {"name": "block", "mass": 1, "pose": [0.1, 0.0, 0], "shapes": [{"vertices": SQUARE}]},
    ],
    "tool": {"mass": 0.1, "pose": [0, 0.05, 0], "shapes": [{"circle": {"radius": 0.01}}]},
    "joints": [{"name": "hinge", "type": "pin", "bodies": ["world", "block"], "at": [0.11, 0.01]}],
    "measure": {"pushed": {"body": "block", "point": [0, 0], "axis": [2, 0], "from": 0.1, "to": 0.3}},
    "task": {"title": "Push", "goal": "Push it.", "done": {"pushed": 0.95}, "words": "{percent} % of the way"},
}
AXIS = {"counts_per_unit": 2e5, "motor_limit": 15.0, "workspace": [-0.1, 0.1], "velocity_limit": 3.0}
AXIS |= {"mass": 0.1, "damping": 3.0}
DEVICE = {"name": "sample", "axes": [{"name": name, **AXIS} for name in ("x", "y", "theta")]}


def changed(content, place, value):
    """The content with one entry replaced, added, or left out."""
    content = copy.deepcopy(content)
    *folders, last = [int(part) if part.isdigit() else part for part in place.split(".")]
    inside = content
    for part in folders:
        inside = inside[part]
    if value is ...:
        del inside[last]
    else:
        inside[last] = value
    return content
