# SPDX-License-Identifier: Apache-2.0
"""Several sub-steps one by one: for a method that offers no `travel` of its own, or a port that sees each of them."""

from functools import partial

from haptic_sim.method import Method, Planar, Travel


def step_by_step(method: Method, start: Planar, start_velocity: Planar, end: Planar, end_velocity: Planar,
                 count: int) -> Travel:
    """`count` sub-steps, the handle going on a straight line from start (exclusive) to end."""
    supplied, touched, force, depth = 0.0, False, 0.0, 0.0
    for k in range(1, count + 1):
        before = method.position
        method.step(_between(start, end, k / count), _between(start_velocity, end_velocity, k / count))
        supplied += sum(f * (b - a) for f, a, b in zip(method.force_on_tool, before, method.position, strict=True))
        if method.touching:
            touched = True
            for contact in method.contacts():
                x, y = contact.force_on_a
                force, depth = max(force, (x * x + y * y) ** 0.5), max(depth, contact.depth)
    return Travel(supplied, touched, force, depth)


def through_port(method: Method, port, start: Planar, start_velocity: Planar, end: Planar, end_velocity: Planar,
                 count: int) -> Travel:
    """The same behind an exchange method's port (tool_port), which says for each sub-step where the handle is."""
    travel = getattr(method, "travel", None) or partial(step_by_step, method)
    supplied, touched, force, depth, left_out, taken, correction = 0.0, False, 0.0, 0.0, 0, 0.0, 0.0
    for k in range(1, count + 1):
        before = method.position
        handle = _between(start, end, k / count), _between(start_velocity, end_velocity, k / count)
        driven = port.drive(*handle, before)
        made = travel(*driven, *driven, 1)
        port.book(method.force_on_tool, before, method.position)
        supplied, touched, left_out = supplied + made.supplied, touched or made.touched, left_out + made.left_out
        force, depth = max(force, made.force), max(depth, made.depth)
        taken, correction = taken + made.contacts, correction + made.correction
    return Travel(supplied, touched, force, depth, left_out, taken, correction)


def _between(start, end, share):
    """Point at `share` of the way; exactly `end` at 1."""
    rest = 1.0 - share
    return (rest * start[0] + share * end[0], rest * start[1] + share * end[1], rest * start[2] + share * end[2])
