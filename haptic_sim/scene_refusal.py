# SPDX-License-Identifier: Apache-2.0
"""What pydantic finds wrong with a scene, in sentences: path, value, limit, unit; of a mistyped key the nearest."""

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, get_args, get_type_hints

from pydantic import ValidationError

from haptic_device.description import without_echoes
from haptic_sim.joint import JOINTS, WORLD
from haptic_sim.solid import SHAPES, TOOL, KeyedShape, Part, Unit

BEYOND = "greater_than", "greater_than_equal", "less_than_equal"
"""Pydantic's names of what is wrong with a number beyond its limit."""


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


def sentences(errors: ValidationError, language: type[Part]) -> list[str]:
    """What is wrong in a mapping of this language; mistyped keys before all, and what is missing only for one of them
    not at all."""
    if isinstance(unfit := _raised(errors), Unfit):
        return list(unfit.found)
    found = without_echoes(errors.errors(include_url=False))
    mistyped = [error for error in found if error["type"] == "extra_forbidden"]
    meant = {
        (*error["loc"][:-1], *_near(str(error["loc"][-1]), _place(error["loc"][:-1], language)[1]))
        for error in mistyped
    }
    others = [error for error in found if error not in mistyped and error["loc"] not in meant]
    return [_sentence(error, language) for error in (*mistyped, *others)]


def _sentence(error: Mapping[str, Any], language: type[Part]) -> str:
    kind, loc, value, more = error["type"], error["loc"], error["input"], error.get("ctx", {})
    problem = error["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    if kind == "extra_forbidden":
        path, parts, _ = _place(loc[:-1], language)
        return _about(path, _no_key(str(loc[-1]), parts))
    if kind.startswith("union_tag"):
        loc, value = (*loc, more["discriminator"].strip("'")), more.get("tag")
        problem = f"it should be one of {more.get('expected_tags')}"
    path, _, unit = _place(loc, language)
    if kind in ("missing", "union_tag_not_found"):
        return f"{path} is missing; add it"
    if kind in BEYOND and unit:
        problem = f"{problem} {unit}"
    plain = all(isinstance(item, str | int | float | None) for item in (value if isinstance(value, list) else [value]))
    return _about(f"{path} is {value!r}" if path and plain and value != [] else path, problem)


def _about(what: str, problem: str) -> str:
    return f"{what}: {problem}" if what else problem


def _known(parts: list[type[Part]]) -> list[str]:
    return [field.alias or name for part in parts for name, field in part.model_fields.items()]


def _near(key: str, parts: list[type[Part]]) -> list[str]:
    """The key that is meant, if there is one like it."""
    return difflib.get_close_matches(key, _known(parts), 1)


def _no_key(key: str, parts: list[type[Part]]) -> str:
    known, near = _known(parts), _near(key, parts)
    return f"has no key {key!r}; " + (f"did you mean {near[0]!r}?" if near else f"known here are {', '.join(known)}")


def _place(loc: tuple[int | str, ...], language: type[Part]) -> tuple[str, list[type[Part]], str]:
    """What pydantic's place is in a mapping: path as it is written, kinds of part that can stand there, unit."""
    path, parts, unit = "", [language], ""
    for step in loc:
        kind = {**JOINTS, **SHAPES}.get(str(step))
        if len(parts) > 1 and kind in parts:  # it tells the kind, and is a key only of some
            parts = [kind]
            if not issubclass(kind, KeyedShape):
                continue
        elif fields := [field for part in parts for field in [_field(part, step)] if field]:
            inside = _nested(fields[0])
            parts = [item for item in inside if isinstance(item, type) and issubclass(item, Part)]
            unit = next((item for item in inside if isinstance(item, Unit)), "")
        path += f"[{step}]" if isinstance(step, int) else f".{step}"
    return path.removeprefix("."), parts, unit


def _field(part: type[Part], key: int | str) -> Any:
    """Type that a field of this key is declared with; None if there is no such."""
    names = [name for name, field in part.model_fields.items() if key == (field.alias or name)]
    return get_type_hints(part, include_extras=True)[names[0]] if names else None


def _nested(annotation: Any) -> list[Any]:
    """An annotation and all that stands in it."""
    return [annotation, *(inner for part in get_args(annotation) for inner in _nested(part))]


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
