# SPDX-License-Identifier: Apache-2.0
"""What pydantic finds wrong with a mapping, in sentences: path, value, limit, unit; of a mistyped key the nearest."""

import difflib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, get_args, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError

Place = tuple[int | str, ...]  # as pydantic tells it
NUMBER, WHOLE, TRUTH = "it should be a number", "it should be a whole number", "it should be true or false"
LISTED, MAPPED = "it should be a list", "it should be a mapping of names to values"
SAID = {
    "greater_than": "it should be greater than {gt:g}",
    "greater_than_equal": "it should be greater than or equal to {ge:g}",
    "less_than_equal": "it should be less than or equal to {le:g}",
    "finite_number": "it should be a finite number",
    "float_type": NUMBER,
    "int_type": WHOLE,
    "int_parsing": WHOLE,
    "int_from_float": WHOLE,
    "bool_type": TRUTH,
    "bool_parsing": TRUTH,
    "string_type": "it should be text",
    "tuple_type": LISTED,
    "frozen_set_type": LISTED,
    "dict_type": MAPPED,
    "model_type": MAPPED,
    "model_attributes_type": MAPPED,
    "string_too_short": "it should have a character at least",
    "string_too_long": "it should have at most {max_length} characters",
    "too_short": "it has {actual_length} entries, and should have at least {min_length}",
    "too_long": "it has {actual_length} entries, and should have at most {max_length}",
    "literal_error": "it should be {expected}",
    "union_tag_invalid": "it should be one of {expected_tags}",
}
"""Each kind of pydantic's errors that scenes and devices can make, as it is said; others have words of their own."""
MEASURED = "greater_than", "greater_than_equal", "less_than_equal"
"""Those that a unit belongs behind."""
COUNTED = "finite_number", "float_type"
"""Those that `in` and a unit belong behind."""


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
    reader = _Reader(language, turns, kinds or {})
    found = _without_echoes(errors.errors(include_url=False))
    mistyped = [error for error in found if error["type"] == "extra_forbidden"]
    meant = {(*error["loc"][:-1], *reader.near(error["loc"])) for error in mistyped}
    others = [error for error in found if error not in mistyped and error["loc"] not in meant]
    return [reader.sentence(error) for error in (*mistyped, *others)]


def _without_echoes(errors: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Without what pydantic calls too short only because the items that it had were wrong."""
    places = [error["loc"] for error in errors]

    def echo(error: Mapping[str, Any]) -> bool:
        own = error["loc"]
        return error["type"] == "too_short" and any(place != own and place[: len(own)] == own for place in places)

    return [error for error in errors if not echo(error)]


class _Reader:
    """Reads pydantic's places in the words of a language."""

    def __init__(self, language: type[Part], turns: Callable[[Place], bool], kinds: Mapping[str, type[Part]]) -> None:
        self._language, self._turns, self._kinds = language, turns, kinds

    def sentence(self, error: Mapping[str, Any]) -> str:
        kind, loc, value, more = error["type"], error["loc"], error["input"], error.get("ctx", {})
        if kind == "extra_forbidden":
            path, parts, _ = self._place(loc[:-1])
            return _about(path, _no_key(str(loc[-1]), parts))
        if kind.startswith("union_tag"):
            loc, value = (*loc, more["discriminator"].strip("'")), more.get("tag")
        path, _, unit = self._place(loc)
        if kind in ("missing", "union_tag_not_found"):
            return f"{path} is missing; add it"
        return _about(_given(path, value), _problem(error, unit))

    def near(self, loc: Place) -> list[str]:
        """The key that is meant by a mistyped one, if there is one like it."""
        return _near(str(loc[-1]), self._place(loc[:-1])[1])

    def _place(self, loc: Place) -> tuple[str, list[type[Part]], str]:
        """What pydantic's place is in a mapping: path as it is written, kinds of part that can stand there, unit."""
        path, parts, unit = "", [self._language], ""
        for step in loc:
            kind = self._kinds.get(str(step))
            if kind and len(parts) > 1 and kind in parts:  # it tells the kind, and is a key only of some
                parts = [kind]
                if not kind.under_key:
                    continue
            elif fields := [field for part in parts for field in [_field(part, step)] if field]:
                inside = _nested(fields[0])
                parts = [item for item in inside if isinstance(item, type) and issubclass(item, Part)]
                unit = next((item for item in inside if isinstance(item, Unit)), "")
            path += f"[{step}]" if isinstance(step, int) else f".{step}"
        return path.removeprefix("."), parts, unit.split(" | ")[-1 if self._turns(loc) else 0]


def _given(path: str, value: Any) -> str:
    """Path and value, if the value is short enough to be said."""
    if value is None:
        return f"{path} is empty" if path else ""
    plain = all(isinstance(item, str | int | float) for item in (value if isinstance(value, list) else [value]))
    return f"{path} is {value!r}" if path and plain and value != [] else path


def _problem(error: Mapping[str, Any], unit: str) -> str:
    kind = error["type"]
    if kind not in SAID:
        return error["msg"].removeprefix("Value error, ")
    said = SAID[kind].format(**error.get("ctx", {}))
    if unit and kind in MEASURED:
        return f"{said} {unit}"
    return f"{said} in {unit}" if unit and kind in COUNTED else said


def _about(what: str, problem: str) -> str:
    return f"{what}: {problem}" if what else problem


def _known(parts: list[type[Part]]) -> list[str]:
    return [field.alias or name for part in parts for name, field in part.model_fields.items()]


def _near(key: str, parts: list[type[Part]]) -> list[str]:
    return difflib.get_close_matches(key, _known(parts), 1)


def _no_key(key: str, parts: list[type[Part]]) -> str:
    known, near = _known(parts), _near(key, parts)
    return f"has no key {key!r}; " + (f"did you mean {near[0]!r}?" if near else f"known here are {', '.join(known)}")


def _field(part: type[Part], key: int | str) -> Any:
    """Type that a field of this key is declared with; None if there is no such."""
    names = [name for name, field in part.model_fields.items() if key == (field.alias or name)]
    return get_type_hints(part, include_extras=True)[names[0]] if names else None


def _nested(annotation: Any) -> list[Any]:
    """An annotation and all that stands in it."""
    return [annotation, *(inner for part in get_args(annotation) for inner in _nested(part))]
