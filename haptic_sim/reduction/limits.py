# SPDX-License-Identifier: Apache-2.0
"""How much the compiled methods can take: their records have a fixed size, since all scenes share one compiled code."""

from haptic_sim.reduction.model import Model

MOST_BODIES, MOST_SHAPES, MOST_CORNERS, MOST_PAIRS, MOST_JOINTS = 40, 80, 400, 1000, 32
MOST_LINKED = 10
"""Bodies of one linkage."""


def too_much(model: Model) -> str:
    """Sentence on what of a model is more than they take; "" if nothing is."""
    for what, many, most in (
        ("bodies", len(model.mass), MOST_BODIES),
        ("shapes", len(model.radius), MOST_SHAPES),
        ("corners", len(model.vertices), MOST_CORNERS),
        ("pairs of shapes that can touch", len(model.pairs), MOST_PAIRS),
        ("joints", len(model.joint_kind), MOST_JOINTS),
        ("bodies in one linkage", _linked(model), MOST_LINKED),
    ):
        if many > most:
            return f"the scene has {many} {what}; the compiled methods take at most {most}"
    return ""


def _linked(model):
    """Bodies of the largest set that joints connect, the world left out."""
    sets = {b: {b} for b in range(len(model.mass)) if not model.fixed[b]}
    for a, b in model.joint_bodies.tolist():
        if a in sets and b in sets:
            sets[a] |= sets[b]
            sets |= dict.fromkeys(sets[a], sets[a])
    return max(map(len, sets.values()))
