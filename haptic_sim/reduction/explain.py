# SPDX-License-Identifier: Apache-2.0
"""What the least model of a scene is, and why, in plain lines."""

from collections.abc import Sequence

from haptic_sim.reduction import Needs, ReducedScene
from haptic_sim.reduction.model import Model


def explain(reduced: ReducedScene) -> list[tuple[str, str]]:
    """(question, answer) of everything that was worked out."""
    needs, model = reduced.needs, reduced.model
    bodies = len(reduced.scene.solids)
    return [
        (
            "bodies",
            f"{len(model.mass) - 1} of {bodies} can move: {_few(needs.moving)}"
            + (f"; nothing ever moves {_few(needs.at_rest)}" if needs.at_rest else ""),
        ),
        ("DOF", _dof(needs, model)),
        ("contacts", _contacts(needs, model)),
        ("friction", "matters" if needs.friction else "no pair that can touch has any"),
        ("restitution", "matters" if needs.restitution else "no pair that can touch has any"),
        (
            "rotation",
            "of the tool changes its position" if needs.rotation else "of the tool does not change its position",
        ),
        ("axes", _axes(needs)),
        ("method", f"{reduced.method}: {reduced.reasons[0]}"),
        ("sub-step", f"{reduced.sub_step * 1e3:g} ms: {reduced.reasons[1]}"),
        *([("error", reduced.unkept)] if reduced.unkept else []),
    ]


def _dof(needs: Needs, model: Model) -> str:
    free = 3 * (len(model.mass) - 1)
    if needs.dof == free:
        return f"{free}, three each"
    return f"{needs.dof} of {free}; joints take the rest"


def _contacts(needs: Needs, model: Model) -> str:
    count, names = len(model.pairs), ", ".join(f"{a}-{b}" for a, b in needs.touching[:6])
    if not count:
        return "none can happen" + (f"; {needs.apart} pairs of shapes never touch" if needs.apart else "")
    more = ", ..." if len(needs.touching) > 6 else ""
    return f"{count} of {count + needs.apart} pairs of shapes can touch: {names}{more}"


def _axes(needs: Needs) -> str:
    if needs.axes is None:
        return "must be solved together"
    if not needs.axes:
        return "x, y and theta are independent, each in closed form: coupling and inertia, no contact"
    listed = " and ".join(f"[{x:.3g}, {y:.3g}]" for x, y in needs.axes)
    return f"contact acts only along {listed}, in closed form; the other axes have only coupling and inertia"


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f", ... ({len(names)})" if len(names) > 8 else "") or "none"
