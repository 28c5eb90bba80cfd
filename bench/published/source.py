# SPDX-License-Identifier: Apache-2.0
"""A source: who published what, and how close ours has to come; read from YAML, nothing of which is executed."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from haptic_device.config import yaml_reader
from haptic_device.config.files import ConfigError
from haptic_device.config.refusal import Part, sentences

EXACT, SHAPE, ORDER = "exact", "shape", "order"
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]


class Result(Part):
    """One published result.

    exact: each of ours is within the share `tolerance` of `published`. shape: ours and `published` differ by a factor
    of `tolerance` at most. order: ours by the names in `order` fall, each by the share `tolerance` at least.
    """

    quantity: Text
    ours: Text
    kind: Literal["exact", "shape", "order"]
    tolerance: Positive
    unit: str = ""
    published: Annotated[tuple[Positive, ...], Field(max_length=12)] = ()
    order: Annotated[tuple[Text, ...], Field(max_length=12)] = ()


class Source(Part):
    """A publication, and a note in plain words: how ours is computed and what differs."""

    authors: Text
    year: Annotated[int, Field(ge=1900, le=2100)]
    title: Text
    venue: Text
    address: Text
    note: Text
    results: Annotated[tuple[Result, ...], Field(min_length=1)]


def load(path: Path) -> Source:
    """The source of this file. Raises ConfigError, one sentence."""
    content = yaml_reader.load(path)
    try:
        source = Source.model_validate(content)
    except ValidationError as error:
        found = sentences(error, Source, lambda place: False)
        raise ConfigError(f"{path}: {found[0]}", found) from None
    if not source.address.startswith(("https://", "http://")):
        raise ConfigError(f"{path}: address is {source.address!r}; it must begin with https:// or http://", [])
    for number, result in enumerate(source.results):
        if problem := _unfinished(result):
            raise ConfigError(f"{path}: results[{number}] {problem}", [problem])
    return source


def _unfinished(result):
    if result.kind == ORDER:
        if result.published or len(result.order) < 2:
            return "is an order; it must have `order` with two names at least, and no `published`"
    elif result.order or not result.published:
        return f"is of kind {result.kind}; it must have `published` with a number at least, and no `order`"
    elif result.kind == SHAPE and result.tolerance < 1.0:
        return f"has tolerance {result.tolerance:g}; a factor must be 1 or more"
    return ""


def missing(result: Result, ours) -> str:
    """What keeps ours, numbers or a mapping of names to numbers, from being compared; empty if nothing does."""
    named = isinstance(ours, dict)
    if result.kind == ORDER:
        absent = [name for name in result.order if not named or name not in ours]
        given = ", ".join(ours) if named else "numbers without names"
        return f"has {absent[0]!r} in `order`; {result.ours} gives {given}" if absent else ""
    if named:
        return f"is of kind {result.kind}; {result.ours} gives named values, {', '.join(ours)}, for kind order"
    if len(ours) != len(result.published):
        return f"has {len(result.published)} numbers in `published`; {result.ours} gives {len(ours)}"
    return ""


def agrees(result: Result, ours) -> bool:
    """Whether ours, numbers or a mapping of names to numbers, is what was published."""
    if result.kind == ORDER:
        values = [ours[name] for name in result.order]
        return all(a - b >= result.tolerance * abs(a) for a, b in zip(values, values[1:], strict=False))
    pairs = list(zip(ours, result.published, strict=True))
    if result.kind == SHAPE:
        return all(value / result.tolerance <= mine <= value * result.tolerance for mine, value in pairs)
    return all(abs(mine - value) <= result.tolerance * value for mine, value in pairs)
