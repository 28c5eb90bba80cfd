# SPDX-License-Identifier: Apache-2.0
"""The record of a scene: its numbers in SI, of one layout, which kernels and the pymunk world read alike.

Body 0 is the tool; the last body is the world, to which everything fixed belongs. Bodies welded together are one body.
A body's frame has its origin in the mass centre, and the axes of the (first) body it was made of.

A record is passed to a kernel as one pointer, and all scenes share one compiled code. So there is a most of each thing;
a scene that has more gets a record of its own size, and the compiled methods refuse it with that number.
"""

from types import SimpleNamespace

import numpy as np

PIN, SLIDER, SPRING = range(3)

MOST = 40, 80, 400, 1000, 32
"""Bodies, shapes, vertices, pairs and joints."""
MOST_LINKED = 10
"""Bodies of one linkage."""


def _declared(n: int, s: int, v: int, p: int, j: int) -> np.dtype[np.void]:
    """Of n bodies, s shapes with v vertices, p pairs of shapes that can touch, j joints.

    A linkage is a set of bodies that joints, springs too, connect. There are l of them, n - 1 at most.
    """
    return np.dtype(
        [
            *((name, "i8") for name in ("bodies", "shapes", "corners", "pair_count", "joints", "linkages")),
            ("gravity", "f8", (2,)),  # m/s²
            ("mass", "f8", (n,)),  # kg; infinite for the world
            ("inertia", "f8", (n,)),  # kg m² about the mass centre
            ("fixed", "i8", (n,)),  # whether the body is the world
            ("pose", "f8", (n, 3)),  # mass centre and angle at the start [m, m, rad]
            ("velocity", "f8", (n, 3)),  # of the mass centre, and angular [m/s, m/s, rad/s]
            ("extent", "f8", (n,)),  # farthest point of the body from its mass centre [m]
            ("shape_body", "i8", (s,)),  # body of each shape
            ("shape_start", "i8", (s + 1,)),  # shape i has vertices[shape_start[i]:shape_start[i + 1]]
            ("radius", "f8", (s,)),  # of a disc [m], 0 for a polygon
            ("middle", "f8", (s, 2)),  # centre of a disc that holds the shape, body's frame [m]
            ("reach", "f8", (s,)),  # radius of that disc [m]
            ("thickness", "f8", (s,)),  # least width of the shape [m]
            ("vertices", "f8", (v, 2)),  # in the body's frame, counter-clockwise [m]; of a disc its centre
            ("disc", "f8", (v,)),  # radius of the disc about a vertex [m], 0 for a polygon's corner
            ("normals", "f8", (v, 2)),  # outward unit normal of the edge that starts at each vertex, body's frame
            # how deep below the surface the edge that starts at a vertex, and that which ends there, is covered [m]
            ("covered", "f8", (v, 2)),
            ("straight", "f8", (v,)),  # the larger of both, if there the surface goes straight on [m]; see `seams`
            ("pairs", "i8", (p, 2)),  # shapes that can touch; the body of the first comes before that of the second
            ("pair_bodies", "i8", (p, 2)),  # their bodies
            ("pair_friction", "f8", (p,)),  # Coulomb coefficient
            ("pair_restitution", "f8", (p,)),  # coefficient of restitution
            # velocity in the plane [m/s] at which the surface of the second shape runs over its body: of a belt
            ("pair_surface", "f8", (p, 2)),
            ("joint_kind", "i8", (j,)),  # PIN, SLIDER or SPRING
            ("joint_bodies", "i8", (j, 2)),  # a and b
            # in the frame of a and of b [m]; those of pins and sliders coincide at the start
            ("joint_anchor", "f8", (j, 2, 2)),
            ("joint_axis", "f8", (j, 2)),  # unit vector of a slider in the frame of a
            ("joint_angle", "f8", (j,)),  # of b less that of a at the start [rad]; a slider keeps it
            ("joint_limit", "f8", (j, 2)),  # least and largest coordinate, which is 0 at the start [rad | m]
            ("joint_friction", "f8", (j,)),  # Coulomb friction against the joint coordinate [N m | N]
            # speed wished [rad/s | m/s] and largest torque or force [N m | N]; without a motor 0, 0. A motor of speed 0
            # is a brake: its strength is added to the joint's friction, and it stands as 0, 0 here.
            ("joint_motor", "f8", (j, 2)),
            # stiffness, damping, rest on the coordinate; a spring's is the anchors' distance, with rest 0 a vector
            ("joint_spring", "f8", (j, 3)),
            # 1/m that its spring-damper sees [1/kg | 1/(kg m²)], each body taken as free
            ("joint_mobility", "f8", (j,)),
            ("linkage", "i8", (n,)),  # linkage of each body; -1 for the world
            ("place_in", "i8", (n,)),  # place of a body within its linkage; -1 for the world
            ("order", "i8", (n - 1,)),  # bodies in the order of their linkages
            ("body_start", "i8", (n + 1,)),  # linkage i has order[body_start[i]:body_start[i + 1]]
            ("joint_order", "i8", (j,)),  # joints in the order of their linkages
            ("joint_start", "i8", (n + 1,)),  # and joint_order[joint_start[i]:joint_start[i + 1]]
            ("rate", "f8", (n,)),  # [1/s] at which a linkage's own spring-dampers act at most, each body taken as free
        ]
    )


RECORD = _declared(*MOST)


class Model(SimpleNamespace):
    """`record`, an array of one, and its arrays by name: views of what of them a scene has."""

    record: np.ndarray


def empty(*counts: int) -> Model:
    """A record for so many bodies, shapes, vertices, pairs and joints, all 0."""
    exact = _declared(*counts)
    fits = all(many <= most for many, most in zip(counts, MOST, strict=True))
    record = np.zeros(1, RECORD if fits else exact)
    for name, many in zip(exact.names or (), counts, strict=False):
        record[name] = many
    shapes = {name: exact[name].shape for name in exact.names or () if exact[name].shape}
    return Model(record=record, **{name: record[name][0][tuple(map(slice, shape))] for name, shape in shapes.items()})


def energy_of(model: Model, pose: np.ndarray, velocity: np.ndarray) -> tuple[float, float]:
    """Kinetic energy of the bodies at these (n - 1, 3), and that of their weight, 0 at the origin [J]."""
    mass, inertia = model.mass[:-1], model.inertia[:-1]
    kinetic = 0.5 * float(mass @ (velocity[:, 0] ** 2 + velocity[:, 1] ** 2) + inertia @ velocity[:, 2] ** 2)
    return kinetic, -float(mass @ (pose[:, :2] @ model.gravity))


def too_much(model: Model) -> str:
    """Sentence on what of a model is more than they take; "" if nothing is."""
    what = "bodies", "shapes", "corners", "pairs of shapes that can touch", "joints", "bodies in one linkage"
    counts = *list(model.record[0])[: len(MOST)], np.bincount(model.linkage[:-1]).max()
    for name, many, most in zip(what, counts, (*MOST, MOST_LINKED), strict=True):
        if many > most:
            return f"the scene has {many} {name}; the compiled methods take at most {most}"
    return ""
