# SPDX-License-Identifier: Apache-2.0
"""The least model that serves a scene: who moves, how freely, who can touch whom, what of contact matters.

Nothing is left out that could be felt: a body is taken for fixed only if no joint, force, velocity or touch can ever
move it, and a pair of shapes is left out only if their reaches (discs, see mobility) are apart.
"""

import math
from typing import NamedTuple

from haptic_sim.method_registry import AUTO
from haptic_sim.reduction.assembly import Place, build
from haptic_sim.reduction.method_choice import (
    choose_method,
    choose_sub_step,
    load_of,
    refusal,
    step_inside,
    unkept_wish,
)
from haptic_sim.reduction.mobility import Touching, degrees_of_freedom, groups_of, moving_bodies, touching_pairs
from haptic_sim.reduction.model import Model
from haptic_sim.scene.geometry import Point, turned
from haptic_sim.scene.language import Scene
from haptic_sim.scene.shapes import TOOL, HalfPlane

SQUARE = 1e-12
"""Sine of the angle below which two directions count as parallel, and cosine as square."""

ASKED = "the parameter method asks for it"


class Needs(NamedTuple):
    """What the model of a scene must contain.

    Attributes:
        moving: bodies that can move, with the tool first.
        at_rest: movable bodies that nothing can ever move.
        dof: degrees of freedom that the joints leave at the start.
        touching: pairs of bodies that can ever touch.
        apart: pairs of shapes that are left out because they never touch.
        friction: whether there is friction.
        restitution: whether there is restitution.
        rotation: whether the rotation of the tool affects its other motion.
        axes: directions in which contact acts, if each can be solved separately in closed form; else None.

    Examples:
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> needs = reduce_scene(load("wall")).needs
        >>> needs.dof, needs.touching, needs.axes
        (3, (('tool', 'wall'),), ((1.0, 0.0),))
    """

    moving: tuple[str, ...]
    at_rest: tuple[str, ...]
    dof: int
    touching: tuple[tuple[str, str], ...]
    apart: int
    friction: bool
    restitution: bool
    rotation: bool
    axes: tuple[tuple[float, float], ...] | None


class ReducedScene(NamedTuple):
    """A scene with its model, ready for simulation.

    Attributes:
        scene: the scene.
        model: the smallest model of the scene, as arrays.
        places: indices of the bodies in the model, by name.
        shape_names: name of the body of each shape in the model.
        needs: what the model must contain.
        method: simulation method of the scene.
        sub_step: [s].
        inside: longest step that `impulse` takes within its sub-step [s].
        reasons: why this method, and why this sub-step, one sentence each.
        unkept: why the `error` of the scene is not reached, if this is known; or "".

    Examples:
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> reduced = reduce_scene(load("wall"))
        >>> reduced.method, reduced.sub_step  # [s]
        ('closed_form', 0.00025)
    """

    scene: Scene
    model: Model
    places: dict[str, Place]
    shape_names: tuple[str, ...]
    needs: Needs
    method: str
    sub_step: float
    inside: float
    reasons: tuple[str, ...]
    unkept: str


def reduce_scene(scene: Scene, method: str | None = None) -> ReducedScene:
    """Computes the smallest model of a scene, and its method and sub-step.

    Raises ValueError if the method cannot simulate the scene.

    Args:
        scene: the scene.
        method: a method that replaces the choice of the scene; `auto` or None keeps the choice of the scene.

    Examples:
        >>> from haptic_sim.reduction import reduce_scene
        >>> from haptic_sim.scene.language import load
        >>> reduce_scene(load("wall"), "impulse").reasons[0]
        'the parameter method asks for it'
    """
    groups = groups_of(scene)
    moving = moving_bodies(scene, groups)
    at_rest = [name for group in groups[:-1] if not moving & set(group) for name in group]
    groups = [group for group in groups[:-1] if moving & set(group)] + [at_rest + groups[-1]]
    touching = touching_pairs(scene, groups)
    arrays, places, shape_names = build(scene, groups, touching.pairs)
    friction, restitution = bool(arrays.pair_friction.any()), bool(arrays.pair_restitution.any())
    needs = Needs(
        moving=tuple(name for group in groups[:-1] for name in group),
        at_rest=tuple(at_rest),
        dof=degrees_of_freedom(arrays),
        touching=touching.names,
        apart=touching.apart,
        friction=friction,
        restitution=restitution,
        rotation=_turning_matters(scene, touching, friction),
        axes=None if friction or restitution else _axes(scene, len(groups), touching),
    )
    why_method, names, load = ASKED, [group[0] for group in groups], load_of(arrays)
    if method in (None, AUTO):
        method, why_method = choose_method(scene, arrays, names, load, needs.axes)
        if scene.method and (refused := refusal(scene, arrays, shape_names, method)):
            raise ValueError(refused)
    sub_step, why_step = choose_sub_step(scene, arrays, method)
    unkept = unkept_wish(scene, arrays, names, load, method, sub_step)
    inside, why = step_inside(arrays, load, scene.error), (why_method, why_step)
    return ReducedScene(scene, arrays, places, shape_names, needs, method, sub_step, inside, why, unkept)


def _turning_matters(scene: Scene, touching: Touching, friction: bool) -> bool:
    """A disc about the grip, without friction or joint, is pushed through its mass centre only."""
    round_tool = all(outline.radius > 0.0 and outline.vertices[0] == (0.0, 0.0) for outline in scene.tool.outlines)
    touched = any(TOOL in pair for pair in touching.names)
    return any(TOOL in joint.bodies for joint in scene.joints) or touched and (friction or not round_tool)


def _axes(scene: Scene, groups: int, touching: Touching) -> tuple[Point, ...] | None:
    """Directions of frictionless walls without rebound, if they are half-planes, and parallel or square."""
    alone = groups == 2 and not any(TOOL in joint.bodies for joint in scene.joints)
    if not alone or _turning_matters(scene, touching, False):
        return None
    walls = [scene.solids[name] for _, name in touching.names]
    normals = []
    for shape, turn in ((shape, wall.pose[2]) for wall in walls for shape in wall.shapes):
        if not isinstance(shape, HalfPlane):
            return None
        x, y = turned(shape.normal, (0.0, 0.0, turn))
        normals.append((x / math.hypot(x, y), y / math.hypot(x, y)))
    axes = [n for i, n in enumerate(normals) if all(abs(n[0] * m[1] - n[1] * m[0]) > SQUARE for m in normals[:i])]
    square = len(axes) < 2 or len(axes) == 2 and abs(axes[0][0] * axes[1][0] + axes[0][1] * axes[1][1]) < SQUARE
    return tuple(axes) if square else None
