# SPDX-License-Identifier: Apache-2.0
"""Which bodies move as one, which can move at all, and which shapes can touch."""

import math

from haptic_sim.geometry import turned
from haptic_sim.joint import WORLD
from haptic_sim.reduction.reach import can_touch, reaches
from haptic_sim.scene_validation import kept_apart
from haptic_sim.solid import TOOL


def groups_of(scene, fixed):
    """Names that make one body each: the tool, movable bodies in the scene's order, the world."""
    groups = {name: [name] for name in (TOOL, *(body.name for body in scene.bodies), WORLD)}

    def join(first, second):
        if groups[first] is not groups[second]:
            groups[first] += groups[second]
            for name in groups[second]:
                groups[name] = groups[first]

    for name in fixed:
        join(WORLD, name)
    for joint in scene.joints:
        if joint.type == "weld":
            join(*sorted(joint.bodies, key=list(groups).index))
    unique = list({id(group): sorted(group, key=list(groups).index) for group in groups.values()}.values())
    return [group for group in unique if WORLD not in group] + [group for group in unique if WORLD in group]


def moving_bodies(scene, groups):
    """Names that something can move: a force, a start velocity, or a touch or joint of one that moves.

    A belt moves only what is pressed upon it, and what presses is one of these.
    """
    group_of = {name: tuple(group) for group in groups for name in group}
    movable = [body for body in (scene.tool, *scene.bodies) if WORLD not in group_of[body.name]]
    discs, apart = reaches(scene, set(group_of) - {body.name for body in movable}), kept_apart(scene)
    driven = {name for joint in scene.joints if joint.motor or joint.stiffness for name in joint.bodies}
    moving, grown = set(), {TOOL} | {body.name for body in movable if any(body.velocity) or body.name in driven}
    if any(scene.gravity):
        grown = {body.name for body in movable}
    while grown != moving:
        moving = {name for start in grown for name in group_of[start]} - {WORLD}
        grown = moving | {
            b.name
            for b in movable
            for a in movable
            if a.name in moving and a is not b and can_touch(apart, a, b, discs)
        }
        grown |= {
            name
            for joint in scene.joints
            if moving & set(joint.bodies)
            for name in joint.bodies
            if WORLD not in group_of[name]
        }
    return moving


def touching_pairs(scene, groups):
    """Pairs of shapes that can touch (indices in the order of the groups) with their surfaces; names; the rest."""
    solids = {body.name: body for body in scene.bodies} | {TOOL: scene.tool}
    discs, held = reaches(scene, set(groups[-1])), kept_apart(scene)
    shapes = [
        (rank, name)
        for rank, group in enumerate(groups)
        for name in group
        if name != WORLD
        for _ in solids[name].outlines
    ]
    pairs, touching, apart = [], {}, 0
    for i, (rank_a, a) in enumerate(shapes):
        for j, (rank_b, b) in enumerate(shapes[i + 1 :], i + 1):
            if rank_a == rank_b:
                continue
            if not can_touch(held, solids[a], solids[b], discs):
                apart += 1
                continue
            one, two = scene.material(solids[a]), scene.material(solids[b])
            surface = turned(solids[b].surface_velocity, (0.0, 0.0, solids[b].pose[2]))
            pairs.append(
                (i, j, math.sqrt(one.friction * two.friction), math.sqrt(one.restitution * two.restitution), surface)
            )
            touching[a, b] = None
    return pairs, tuple(touching), apart
