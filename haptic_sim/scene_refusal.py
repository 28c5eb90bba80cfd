# SPDX-License-Identifier: Apache-2.0
"""What pydantic finds wrong with a scene in one sentence: path, value, limit, unit; of a mistyped key the nearest."""

import difflib
from typing import Any, get_args, get_type_hints

from pydantic import ValidationError

from haptic_sim.joint import JOINTS
from haptic_sim.solid import SHAPES, KeyedShape, Part, Unit

BEYOND = "greater_than", "greater_than_equal", "less_than_equal"
"""Pydantic's names of what is wrong with a number beyond its limit."""


def sentence(errors: ValidationError, language: type[Part]) -> str:
    """The first thing wrong in a mapping of this language; a mistyped key before all, since another seems missing."""
    found = errors.errors(include_url=False)
    error = next((error for error in found if error["type"] == "extra_forbidden"), found[0])
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


def _no_key(key: str, parts: list[type[Part]]) -> str:
    known = [field.alias or name for part in parts for name, field in part.model_fields.items()]
    near = difflib.get_close_matches(key, known, 1)
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
