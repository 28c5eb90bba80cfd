# SPDX-License-Identifier: Apache-2.0
"""What a scene asks for that the sweeps of `impulse` cannot give; `python -m bench impulse_bounds` measures the bounds.

Sequential impulses pass a load on from contact to contact: of two bodies with mass ratio R a sweep leaves R/(1 + R),
and up a tower of n the load has come one body farther. The sweeps are counted, so what is left of the load after the
last is an overlap, and where one body strikes another, energy. Both grow with R n. A coupling is an effective mass in
the tool, m + h² K: it makes a light tool heavier, by 5 mg at 2000 N/m, and asks for nothing more.
"""

import math

from haptic_sim.geometry import Outline, distance
from haptic_sim.reduction.modes import longest_step

SHORT = 0.05e-3
"""s; what `impulse` steps by inside its sub-steps. It cannot keep up with shorter ones behind a port that sees each."""
HOLDS = 3e-3
"""Relative error that `impulse` stays below in every shipped scene with a closed form or stored reference."""
LOAD = 60.0
"""Mass ratio times bodies on one another up to which it overlaps below 0.1 mm and creates below 1 % of the energy."""
HIGH = 15
"""Bodies on one another up to which a tower stands: of 20 equal ones it sinks in by 1.3 mm in two of six positions
(`python -m bench hard_cases --scenes stack_20`)."""
TOUCHING = 1e-5
"""m; bodies that are no farther apart at the start rest on each other."""


def beyond(scene, model, names) -> str:
    """What the scene asks for beyond `impulse`, in words; "" if nothing. `names`: of the bodies of the model."""
    if scene.error < HOLDS:
        return f"error {scene.error:g} is wanted; impulse holds {HOLDS:g}"
    longest, why = longest_step(model, scene.error)
    if longest < SHORT:
        return f"{why}, and impulse cannot keep up with steps below {SHORT * 1e3:g} ms"
    pairs = {tuple(pair) for pair in model.shape_body[model.pairs].tolist() + model.joint_bodies.tolist()}
    ratio, light, heavy = max(_ratios(model, pairs), default=(1.0, 0, 0))
    height = max(1, _height(model))
    if height > HIGH:
        return f"{height} bodies stand on one another, and impulse carries {HIGH}"
    if ratio * height > LOAD:
        return (
            f"{names[heavy]} is {ratio:.4g} times as heavy as {names[light]}"
            + (f", and {height} bodies stand on one another" if height > 1 else "")
            + f": a load of {ratio * height:.4g}, of which impulse carries {LOAD:g}"
        )
    return ""


def _ratios(model, pairs):
    """(mass ratio, light body, heavy body) of those two that can both move."""
    for a, b in pairs:
        if not (model.fixed[a] or model.fixed[b]):
            light, heavy = sorted((a, b), key=lambda body: model.mass[body])
            yield model.mass[heavy] / model.mass[light], light, heavy


def _height(model):
    """Bodies of the highest tower: how many steps from touch to touch the farthest body is from what is fixed."""
    near = {}
    for a, b in _touching(model):
        near.setdefault(a, set()).add(b)
        near.setdefault(b, set()).add(a)
    ground = len(model.mass) - 1
    height, seen, layer = 0, {ground}, {ground}
    while layer := {body for under in layer for body in near.get(under, ())} - seen:
        height, seen = height + 1, seen | layer
    return height


def _touching(model):
    """Pairs of bodies that touch at the start."""
    shapes = [_outline(model, s) for s in range(len(model.radius))]
    discs = [_disc(*shape) for shape in shapes]
    for i, j in model.pairs.tolist():
        (xa, ya, ra), (xb, yb, rb) = discs[i], discs[j]
        if math.hypot(xa - xb, ya - yb) <= ra + rb + TOUCHING and distance(*shapes[i], *shapes[j]) <= TOUCHING:
            yield model.shape_body[i], model.shape_body[j]


def _outline(model, s):
    corners = model.vertices[model.shape_start[s] : model.shape_start[s + 1]]
    return Outline(tuple(map(tuple, corners.tolist())), float(model.radius[s])), tuple(model.pose[model.shape_body[s]])


def _disc(outline, pose):
    """Centre and radius of a disc that holds the shape [m]: about its body's mass centre."""
    return pose[0], pose[1], max(math.hypot(*corner) for corner in outline.vertices) + outline.radius
