# SPDX-License-Identifier: Apache-2.0
"""Numbers as a reader wants them: no digits beyond the error, a unit of the right size, a true minus."""

import math

UNKNOWN = "—"
_PREFIXES = (("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", 1e-9))


def plain(value: float, unit: str = "") -> str:
    """Up to three digits, whole numbers from 1000 on, never a power of ten; UNKNOWN where it is no number."""
    if not math.isfinite(value):
        return UNKNOWN
    text = _fixed(value, max(0, 2 - _power(value)))
    return _with_unit(text.rstrip("0").rstrip(".") if "." in text else text, unit)


def amount(value: float, unit: str) -> str:
    """Up to three digits and the prefix that suits, from nano to none; what is smaller is `under 1 n` of the unit."""
    if not math.isfinite(value) or value == 0.0:
        return plain(value, unit)
    size = abs(float(f"{value:.2e}"))
    for prefix, factor in _PREFIXES:
        if size >= factor * (1.0 - 1e-9):
            return plain(value / factor, f"{prefix}{unit}")
    return f"under 1 n{unit}"


def with_error(value: float, error: float, unit: str = "") -> str:
    """`value ± error unit`: the error with one digit, or two where the first is a 1; the value to the same place."""
    if not (math.isfinite(value) and math.isfinite(error) and error > 0.0):
        return _with_unit(f"{plain(value)} ± {plain(error)}", unit)
    error = float(f"{error:.1e}")
    places = (error < 1.95 * 10.0 ** _power(error)) - _power(error)
    return _with_unit(f"{_fixed(value, places)} ± {_fixed(error, places)}", unit)


def _power(value: float) -> int:
    """Of ten, in the first of three digits."""
    return int(f"{value:.2e}".partition("e")[2])


def _fixed(value: float, places: int) -> str:
    """To so many places behind the point, or before it where they are negative."""
    text = f"{round(value, places):.{max(0, places)}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit and text != UNKNOWN else text
