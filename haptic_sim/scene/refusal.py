# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a scene, in sentences: in its parts, and with right parts that do not fit together."""

from collections.abc import Iterable, Sequence
from typing import Any

from pydantic import ValidationError

from haptic_device.config.refusal import Part, sentences
from haptic_sim.scene.joints import JOINTS, WORLD
from haptic_sim.scene.shapes import SHAPES, TOOL


class Unfit(ValueError):
    """Parts that are right and do not fit together: `found` has the sentences."""

    def __init__(self, found: Sequence[str]) -> None:
        super().__init__(found[0])
        self.found = tuple(found)


def is_unfit(errors: ValidationError) -> bool:
    """Whether all parts are right and only do not fit together."""
    return isinstance(_raised(errors), Unfit)


def _raised(errors: ValidationError) -> Exception | None:
    return errors.errors(include_url=False)[0].get("ctx", {}).get("error")


def found_wrong(errors: ValidationError, language: type[Part]) -> list[str]:
    """What is wrong in a mapping of this language, or with parts of it that do not fit together."""
    if isinstance(unfit := _raised(errors), Unfit):
        return list(unfit.found)
    kinds: dict[str, Any] = {**JOINTS, **SHAPES}
    return sentences(errors, language, lambda place: "pin" in place, kinds)


_NOTHING: dict[str, Any] = {"layers": [], "shapes": [{"circle": {"radius": 1e-3}}]}
_TOOL = {**_NOTHING, "mass": 1.0}
_JOINT = {"type": "spring", "bodies": [TOOL, WORLD], "anchors": [[0, 0], [0, 0]], "stiffness": 1.0, "rest": 0.0}
_STAND_INS: dict[str, dict[str, Any]] = {
    "bodies": {**_NOTHING, "fixed": True},
    "joints": _JOINT,
    "materials": {},
    "measure": {"from": 0.0, "to": 1.0},
}


def with_stand_ins(content: dict[Any, Any], wrong: Iterable[tuple[int | str, ...]]) -> dict[Any, Any]:
    """A scene's mapping without the entries at these places, or with what fits whatever is around it in their place."""
    rest: dict[Any, Any] = {"name": "", **content}
    stood: set[str] = set()
    for key, *inner in filter(None, wrong):
        entries = rest.pop(key, None)
        if key == TOOL:
            rest[TOOL] = _TOOL
            stood.add(TOOL)
        elif key in _STAND_INS and inner:
            rest[key], at = entries.copy(), inner[0]
            rest[key][at] = _STAND_INS[key]
            if key == "bodies":
                rest[key][at] = _STAND_INS[key] | {"name": _name(entries[at], at)}
                stood.add(rest[key][at]["name"])
        elif key == "measure":
            rest.pop("task", None)  # its goals are measures
    if "joints" in rest:
        rest["joints"] = [_JOINT if stood & set(joint["bodies"]) else joint for joint in rest["joints"]]
    return rest


def _name(body: Any, place: int | str) -> str:
    name = body.get("name") if isinstance(body, dict) else None
    return name if isinstance(name, str) else f"bodies[{place}]"
