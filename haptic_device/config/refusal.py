# SPDX-License-Identifier: Apache-2.0
"""What pydantic finds wrong with a mapping, in sentences: path, value, limit, unit; of a mistyped key the nearest."""

import re
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from haptic_device.config.files import nearest

Place = tuple[int | str, ...]  # as pydantic tells it
WORDS = {
    r"^\w+ should": "it should",
    r"valid (tuple|frozenset)": "list",
    r"valid dictionary.*": "mapping of names to values",
    r"valid number": "number",
    r"valid integer.*": "whole number",
    r"a valid boolean.*": "true or false",
    r"a valid string": "text",
    r"after validation, not (\d+)": r"and has \1",
    r"^Input tag (.*) found using '(\w+)' .* tags:": r"\2 is \1; it should be one of",
    r"^Unable to extract tag using discriminator '(\w+)'": r"\1 is missing; add it",
}
"""What pydantic says in the words of Python, and how it is said to who writes YAML."""


class Unit(str):
    """Unit of a number, for the sentence that says its limit; `m | rad`: of what goes straight, and of what turns."""


class Part(BaseModel):
    """A mapping that a file has: no key but its own, and nothing changes in it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    under_key: ClassVar[bool] = False
    """Whether it is written as a mapping under the key that tells its kind."""


def sentences(
    errors: ValidationError,
    language: type[Part],
    turns: Callable[[Place], bool],
    kinds: Mapping[str, type[Part]] | None = None,
) -> list[str]:
    """What is wrong in a mapping of this language, one sentence each.

    Mistyped keys come before all, and what is missing only for one of them not at all.

    turns: whether a place is in a part that turns. kinds: the parts of which one is told by a key or a word.
    """
    found = [(error, *_place(error["loc"], language, kinds or {})) for error in errors.errors(include_url=False)]
    mistyped = [_mistyped(*each) for each in found if each[0]["type"] == "extra_forbidden"]
    meant = {place for place, _ in mistyped}
    others = [
        _sentence(error, path, unit.split(" | ")[-1 if turns(error["loc"]) else 0])
        for error, path, _, unit in found
        if error["type"] != "extra_forbidden" and error["loc"] not in meant and not _echo(error)
    ]
    return [*(sentence for _, sentence in mistyped), *others]


def _echo(error: Mapping[str, Any]) -> bool:
    """Whether pydantic calls something too short only because the items that it had were wrong."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def _place(loc: Place, language: type[Part], kinds: Mapping[str, type[Part]]) -> tuple[str, list[type[Part]], str]:
    """What pydantic's place is in a mapping: path as it is written, kinds of part that it is in or may be, unit."""
    path, within, parts, unit = "", [language], [language], ""
    for step in loc:
        within, kind = parts, kinds.get(str(step))
        if kind and len(parts) > 1 and kind in parts:  # it tells the kind, and is a key only of some
            parts = [kind]
            if not kind.under_key:
                continue
        elif fields := [field for part in parts for name, field in _keys(part) if name == step]:
            inside = [*fields[0].metadata, *_nested(fields[0].annotation)]
            parts = [item for item in inside if isinstance(item, type) and issubclass(item, Part)]
            unit = next((item for item in inside if isinstance(item, Unit)), "")
        path += f"[{step}]" if isinstance(step, int) else f".{step}"
    return path.removeprefix("."), within, unit


def _keys(part: type[Part]) -> list[tuple[str, Any]]:
    return [(field.alias or name, field) for name, field in part.model_fields.items()]


def _nested(annotation: Any) -> list[Any]:
    """An annotation and all that stands in it."""
    return [annotation, *(inner for part in get_args(annotation) for inner in _nested(part))]


def _mistyped(error: Mapping[str, Any], path: str, parts: list[type[Part]], unit: str) -> tuple[Place, str]:
    """The place that is meant by a mistyped key, and the sentence that says so."""
    *before, key = error["loc"]
    known = [name for part in parts for name, _ in _keys(part)]
    near = nearest(str(key), known)
    told = f"did you mean {near!r}?" if near else f"known here are {', '.join(known)}"
    return (*before, near), _about(path.removesuffix(str(key)).removesuffix("."), f"has no key {str(key)!r}; {told}")


def _sentence(error: Mapping[str, Any], path: str, unit: str) -> str:
    if error["type"] == "missing":
        return f"{path} is missing; add it"
    said = error["msg"].removeprefix("Value error, ")
    if error["type"] != "value_error":  # which is a sentence of ours
        for python, plain in WORDS.items():
            said = re.sub(python, plain, said)
        said += "" if not unit else f" {unit}" if said[-1].isdigit() else f" in {unit}"
    return _about(_given(path, error["input"]), said)


def _given(path: str, value: Any) -> str:
    """Path and value, if the value is short enough to be said."""
    if value is None:
        return f"{path} is empty" if path else ""
    plain = all(isinstance(item, str | int | float) for item in (value if isinstance(value, list) else [value]))
    return f"{path} is {value!r}" if path and plain and value != [] else path


def _about(what: str, problem: str) -> str:
    return f"{what}: {problem}" if what else problem
