# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a scene, in sentences: in its parts, and with right parts that do not fit together."""

from collections.abc import Iterable, Sequence
from typing import Any

from pydantic import ValidationError

from haptic_device.refusal import Part, sentences
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
_TOOL, _BODY = {**_NOTHING, "mass": 1.0}, {**_NOTHING, "fixed": True}
_MENDED = "bodies", "joints", "materials", "measure"
_JOINT = {"type": "spring", "bodies": [TOOL, WORLD], "anchors": [[0, 0], [0, 0]], "stiffness": 1.0, "rest": 0.0}


def with_stand_ins(content: dict[Any, Any], wrong: Iterable[tuple[int | str, ...]]) -> dict[Any, Any]:
    """A scene's mapping without the entries at these places, or with what fits whatever is around it in their place."""
    bad: dict[Any, set[Any]] = {}
    for key, *inner in filter(None, wrong):
        bad.setdefault(key, set()).update(inner[:1])
    rest = {"name": ""} | {key: entries for key, entries in content.items() if key not in bad}
    rest |= {key: _mended(key, content[key], places) for key, places in bad.items() if places and key in _MENDED}
    if "measure" in bad:
        rest.pop("task", None)  # its goals are measures
    stood = {rest["bodies"][i]["name"] for i in bad.get("bodies", ())}
    if TOOL in bad:
        rest[TOOL], stood = _TOOL, stood | {TOOL}
    if "joints" in rest:
        rest["joints"] = [_JOINT if stood & set(joint["bodies"]) else joint for joint in rest["joints"]]
    return rest


def _mended(key: str, entries: Any, bad: set[Any]) -> Any:
    """Bodies, joints, materials or measures with something in place of those that are bad."""
    if key == "bodies":
        return [_body(body, i) if i in bad else body for i, body in enumerate(entries)]
    if key == "joints":
        return [_JOINT if i in bad else joint for i, joint in enumerate(entries)]
    kept = {name: entry for name, entry in entries.items() if name not in bad}
    return kept if key == "measure" else kept | {name: {} for name in bad}


def _body(body: Any, place: int) -> dict[str, Any]:
    name = body.get("name") if isinstance(body, dict) else None
    return {**_BODY, "name": name if isinstance(name, str) else f"bodies[{place}]"}
