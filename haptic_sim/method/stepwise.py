# SPDX-License-Identifier: Apache-2.0
"""Several sub-steps one by one, for a port that sees each of them."""

from haptic_sim.method import Method, Planar, StepResult


def through_port(
    method: Method, port, start: Planar, start_velocity: Planar, end: Planar, end_velocity: Planar, count: int
) -> StepResult:
    """`count` sub-steps behind an exchange method's port (tool_port), which says for each where the handle is.

    As wanted it would go on a straight line from start (exclusive) to end; it is held for a sub-step, where it is in
    the mean of the steps that this is taken in.
    """
    supplied, touched, force, depth, left_out, taken, correction = 0.0, False, 0.0, 0.0, 0, 0.0, 0.0
    lost = None
    early = 0.5 - 0.5 / method.inner
    for k in range(1, count + 1):
        before, share = method.position, (k - early) / count
        handle = _between(start, end, share), _between(start_velocity, end_velocity, share)
        driven = port.drive(*handle, before)
        made = method.travel(*driven, *driven, 1)
        port.book(made.supplied, method.force_on_tool, before, method.position)
        supplied, touched, left_out = supplied + made.supplied, touched or made.touched, left_out + made.left_out
        force, depth = max(force, made.force), max(depth, made.depth)
        taken, correction = taken + made.contacts, correction + made.correction
        lost = None if made.numerical is None else (lost or 0.0) + made.numerical
    return StepResult(supplied, touched, force, depth, left_out, taken, correction, lost)


def _between(start, end, share):
    """Point at `share` of the way; exactly `end` at 1."""
    rest = 1.0 - share
    return (rest * start[0] + share * end[0], rest * start[1] + share * end[1], rest * start[2] + share * end[2])
