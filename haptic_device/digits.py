# SPDX-License-Identifier: Apache-2.0
"""Numbers as a reader wants them: no digits beyond the error, a unit of the right size, a true minus."""

import math

UNKNOWN = "—"
LEAST = 1e-9  # of any unit: what is less is not told apart from nothing
_PREFIXES = (("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", LEAST))
_PREFIXED = ("m", "s", "J", "N", "m/s")
_MOST = 15  # digits of which every one is true


def plain(value: float, unit: str = "", digits: int = 3) -> str:
    """Up to so many digits, whole numbers where that is less; never a power of ten; UNKNOWN where it is no number."""
    if not math.isfinite(value):
        return UNKNOWN
    text = _fixed(value, max(0, digits - 1 - _power(value, digits)))
    return _with_unit(text.rstrip("0").rstrip(".") if "." in text else text, unit)


def amount(value: float, unit: str) -> str:
    """As `plain`, and m, s, J, N and m/s with the prefix that suits, from nano to none; below that `under 1 n` of the
    unit. Other units have no prefix."""
    if not math.isfinite(value) or value == 0.0:
        return plain(value, unit)
    size = abs(float(f"{value:.2e}"))
    if unit not in _PREFIXED:
        return plain(value if size >= LEAST else 0.0, unit)
    for prefix, factor in _PREFIXES:
        if size >= factor * (1.0 - 1e-9):
            return plain(value / factor, f"{prefix}{unit}")
    return f"under 1 n{unit}"


def with_error(value: float, error: float | None, unit: str = "") -> str:
    """`value ± error unit`: the error with one digit, or two where the first is a 1; the value to the same place. As
    `plain` where there is no error."""
    if error is None:
        return plain(value, unit)
    if not (math.isfinite(value) and math.isfinite(error) and error > 0.0):
        return _with_unit(f"{plain(value)} ± {plain(error)}", unit)
    error = float(f"{error:.1e}")
    places = (error < 1.95 * 10.0 ** _power(error)) - _power(error)
    return _with_unit(f"{_fixed(value, places)} ± {_fixed(error, places)}", unit)


def apart(value: float, limit: float, most: int = _MOST) -> tuple[str, str]:
    """Both as `plain`, with more than three digits, up to `most`, where these would not tell them apart."""
    for digits in range(3, most + 1):
        told = plain(value, digits=digits), plain(limit, digits=digits)
        if told[0] != told[1]:
            return told
    return plain(value), plain(limit)


def _power(value: float, digits: int = 3) -> int:
    """Of ten, in the first of so many digits."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2])


def _fixed(value: float, places: int) -> str:
    """To so many places behind the point, or before it where they are negative."""
    text = f"{round(value, places):.{max(0, places)}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit and text != UNKNOWN else text
