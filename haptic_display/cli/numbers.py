# SPDX-License-Identifier: Apache-2.0
"""Options that take a number: what is none, not finite or out of range is refused in one sentence, with its unit."""

from typing import Any

import typer

from haptic_device.config.parameter_types import Parameter, check_value


def number(unit: str, low: float | None = None, high: float | None = None, **more: Any) -> Any:
    """typer.Option of a decimal number from low to high, in `unit`; without limits the command itself judges it."""
    return _option(float, unit, low, high, more)


def whole(low: int, high: int, **more: Any) -> Any:
    """typer.Option of a whole number from low to high."""
    return _option(int, "", low, high, more)


def _option(kind, unit, low, high, more):
    limits = {key: kind(limit) for key, limit in (("low", low), ("high", high)) if limit is not None}

    def judged(option: typer.CallbackParam, text):
        if text is None:
            return None
        parameter = Parameter(option.opts[0], kind(), unit, "", **limits)
        try:
            value = _read(kind, parameter, text)
            return check_value(parameter, value) if limits else value
        except ValueError as refusal:
            typer.echo(f"haptic: {refusal}", err=True)
            raise typer.Exit(2) from None

    shown = ["FLOAT" if kind is float else "INTEGER", *([f"{low:g}..{high:g}"] if limits else []), unit]
    return typer.Option(parser=str, callback=judged, metavar=" ".join(shown).strip(), **more)


def _read(kind, parameter, text):
    try:
        return kind(text)
    except ValueError:
        wanted = "a number" if kind is float else "a whole number"
        unit = f" in {parameter.unit}" if parameter.unit else ""
        raise ValueError(f"{parameter.name} is {text!r}; {wanted}{unit} is needed") from None
