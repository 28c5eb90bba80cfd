# SPDX-License-Identifier: Apache-2.0
"""Quantities that the analysis is given: refused in a sentence with name, value, limit and unit, or taken; or grids."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]
Flags = npt.NDArray[np.bool_]
Quantity = float | Array
"""A number, or an array of them that broadcasts."""


def positive(name: str, value: npt.ArrayLike, unit: str) -> None:
    """Refuse a quantity that is not finite and greater than zero (ValueError)."""
    good = np.isfinite(value) & (np.asarray(value) > 0.0)
    _refuse_unless(good, name, value, "must be a finite number greater than 0", unit)


def not_negative(name: str, value: npt.ArrayLike, unit: str) -> None:
    """Refuse a quantity that is not finite or lies below zero (ValueError)."""
    good = np.isfinite(value) & (np.asarray(value) >= 0.0)
    _refuse_unless(good, name, value, "must be a finite number, at least 0", unit)


def finite(name: str, value: npt.ArrayLike, unit: str) -> None:
    """Refuse a quantity that is not a finite number (ValueError)."""
    _refuse_unless(np.isfinite(value), name, value, "must be a finite number", unit)


def within(name: str, value: npt.ArrayLike, low: float, high: float, unit: str) -> None:
    """Refuse a quantity that is not finite or lies outside [low, high] (ValueError)."""
    inside = (np.asarray(value) >= low) & (np.asarray(value) <= high)
    _refuse_unless(inside, name, value, f"must lie between {low:g} and {high:g}", unit)


def _refuse_unless(good: npt.ArrayLike, name: str, value: npt.ArrayLike, limit: str, unit: str) -> None:
    good, value = np.broadcast_arrays(good, value)
    if not np.all(good):
        unit = f" {unit}" if unit else ""
        raise ValueError(f"{name} is {value[~good].flat[0]:g}{unit}, but it {limit}{unit}")


def over_grids(function: Callable[..., float]) -> Callable[..., Any]:
    """The same function of numbers for arrays of them, which broadcast; numbers give a number."""
    many = np.vectorize(function, otypes=[float])
    return functools.wraps(function)(lambda *given, **named: many(*given, **named)[()])
