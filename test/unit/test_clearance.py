# SPDX-License-Identifier: Apache-2.0
"""Signed distances against closed forms, and random polygons against their Minkowski difference."""

import math

import numpy as np
import pytest
from examples import few
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from haptic_sim.scene.geometry import Outline, distance, overlap, rectangle

EXACT = 1e-12
HERE = (0.0, 0.0, 0.0)
REGULAR = [[(math.cos(2 * math.pi * i / n), math.sin(2 * math.pi * i / n)) for i in range(n)] for n in (3, 4, 5, 8)]


def box(width, height):
    return Outline(rectangle((width, height), (0.0, 0.0), 0.0))


def disc(radius, center=(0.0, 0.0)):
    return Outline((center,), radius)


ECCENTRIC = disc(0.2, (0.1, 0.0))


@pytest.mark.parametrize(
    ("a", "b", "pose", "expected"),
    [
        (box(2.0, 2.0), disc(0.5), (1.7, 0.2, 1.0), 0.2),  # a face, from outside and from within
        (box(2.0, 2.0), disc(0.5), (0.6, 0.2, 1.0), -0.9),
        (box(2.0, 2.0), disc(0.5), (1.7, 1.9, 0.0), math.hypot(0.7, 0.9) - 0.5),  # a corner
        (disc(0.3), ECCENTRIC, (0.9, 0.0, math.pi / 2), math.hypot(0.9, 0.1) - 0.5),
        (disc(0.3), ECCENTRIC, (0.1, 0.0, math.pi / 2), math.hypot(0.1, 0.1) - 0.5),
    ],
)
def test_a_disc_is_as_far_as_its_centre_less_its_radius(a, b, pose, expected):
    assert distance(a, HERE, b, pose) == pytest.approx(expected, abs=EXACT)


@pytest.mark.parametrize("unit", [1e-4, 1e-3, 1.0, 100.0])
@pytest.mark.parametrize("gap", [0.5, 1e-3, 1e-6, 0.0, -1e-6, -1e-3, -0.5])
def test_boxes_side_by_side_are_as_far_apart_as_their_faces(unit, gap):
    square = box(2 * unit, 2 * unit)
    found = distance(square, HERE, square, ((2 + gap) * unit, 0.3 * unit, 0.0))
    assert found == pytest.approx(gap * unit, abs=EXACT * unit)


def test_an_overlap_is_the_deepest_of_all_parts_and_none_is_zero():
    hole = [Outline(rectangle((0.05, 0.04), (side * 0.0351, -0.02), 0.0)) for side in (-1, 1)]
    peg = [box(0.02, 0.06), disc(0.0103)]
    assert overlap(peg[:1], (1.5e-4, 0.0, 0.0), hole, HERE) == pytest.approx(0.5e-4, abs=EXACT)
    assert overlap(peg, (0.0, -0.01, 0.0), hole, HERE) == pytest.approx(2e-4, abs=EXACT)
    assert overlap(peg[:1], HERE, hole, HERE) == 0.0


@pytest.mark.parametrize(("along", "expected"), [(0.35, 0.5 - 0.35 * math.sqrt(2.0)), (0.36, 0.0)])
def test_a_disc_at_a_corner_overlaps_only_once_it_reaches_the_corner(along, expected):
    """Its centre is within the radius of both faces' lines all the time."""
    assert overlap([box(2.0, 2.0)], HERE, [disc(0.5)], (1.0 + along, 1.0 + along, 0.0)) == pytest.approx(expected)


ALIGNED = st.sampled_from([0.0, 0.5, 1.0, -1.5, 2.0, -2.0, math.sqrt(0.5), 1e-5, 1e-12, 5e-324])
PLACE = ALIGNED | st.floats(-3.0, 3.0)
ANGLE = ALIGNED | st.sampled_from([math.pi, math.pi / 2, -math.pi / 4]) | st.floats(-4.0, 4.0)


@few(100)
@given(
    st.sampled_from(REGULAR),
    st.sampled_from(REGULAR),
    st.sampled_from([1.0, 2.0]) | st.floats(0.01, 10.0),
    PLACE,
    PLACE,
    ANGLE,
    st.sampled_from([0.0, -3.0]) | st.floats(-4.0, 0.0),
)
def test_the_distance_is_that_of_the_origin_from_the_difference_of_both_shapes(a, b, stretch, x, y, angle, decade):
    """The Minkowski difference of two convex shapes holds the origin iff they overlap, as deep as they do."""
    unit = 10.0**decade
    first, second, pose = np.array(a) * unit * (1.0, stretch), np.array(b) * unit, (x * unit, y * unit, angle)
    found = distance(_outline(first), HERE, _outline(second), pose)
    c, s = math.cos(angle), math.sin(angle)
    placed = second @ np.array([[c, s], [-s, c]]) + pose[:2]
    rounding = 1e-12 * unit * max(1.0, stretch)
    deep = overlap([_outline(first)], HERE, [_outline(second)], pose)
    assert deep == pytest.approx(max(0.0, -found), abs=rounding)
    assert found == pytest.approx(_origin_to_hull((placed[:, None] - first).reshape(-1, 2) / unit) * unit, abs=rounding)
    assert distance(_outline(second), pose, _outline(first), HERE) == pytest.approx(found, abs=rounding)


def _outline(vertices):
    return Outline(tuple(map(tuple, vertices.tolist())))


def _origin_to_hull(points):
    hull = ConvexHull(points)
    height = hull.equations[:, 2].max()  # of the origin over the facet it is farthest out of
    if height < 0.0:
        return height
    corners = points[hull.vertices]
    return min(_origin_to_edge(p, q) for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True))


def _origin_to_edge(p, q):
    share = np.clip(-p @ (q - p) / ((q - p) @ (q - p)), 0.0, 1.0)
    return float(np.linalg.norm(p + share * (q - p)))
