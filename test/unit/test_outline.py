# SPDX-License-Identifier: Apache-2.0
"""Outlines: area, mass centre and inertia are those of the textbook."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from haptic_sim.scene.geometry import Outline, combined, convex, rectangle
from haptic_sim.scene.shapes import Tool


@given(st.floats(1e-3, 10), st.floats(1e-3, 10), st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4))
def test_lamina_of_a_rectangle_is_that_of_the_textbook_wherever_it_lies(width, height, x, y, angle):
    lamina = combined([Outline(rectangle((width, height), (x, y), angle))])
    area = width * height
    assert lamina.area == pytest.approx(area, rel=1e-9)
    assert lamina.centroid == pytest.approx((x, y), abs=1e-9)
    assert lamina.second_moment == pytest.approx(area * (width**2 + height**2) / 12, rel=1e-8)


def test_two_halves_have_the_inertia_of_the_whole():
    halves = combined([Outline(rectangle((1.0, 2.0), (x, 0.0), 0.0)) for x in (-0.5, 0.5)])
    assert halves.second_moment == pytest.approx(4.0 * (2.0**2 + 2.0**2) / 12, rel=1e-12)


def test_tool_s_inertia_is_taken_about_the_grip():
    tool = Tool(mass=0.1, shapes=[{"circle": {"radius": 0.01, "center": [0, 0.02]}}])
    assert tool.mass_properties.inertia == pytest.approx(0.1 * (0.01**2 / 2 + 0.02**2), rel=1e-12)
    assert tool.mass_properties.center == (0.0, 0.0)


@given(st.integers(3, 12), st.booleans(), st.floats(0, 7))
def test_vertices_may_be_listed_in_either_sense_and_come_out_counter_clockwise(count, clockwise, angle):
    turns = [angle + 2 * math.pi * i / count for i in range(count)]
    ring = [(math.cos(turn), math.sin(turn)) for turn in turns]
    expected = 0.5 * count * math.sin(2 * math.pi / count)
    assert combined([Outline(convex(ring[::-1] if clockwise else ring))]).area == pytest.approx(expected, rel=1e-12)
