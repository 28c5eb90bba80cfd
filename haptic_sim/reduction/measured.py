# SPDX-License-Identifier: Apache-2.0
"""What each method that a shipped scene could have costs, and its error: a table kept with the package.

`python -m bench chosen --out haptic_sim/reduction/measured.csv`, in a clone of the sources, measures it anew.
"""

import csv
import math
from pathlib import Path
from typing import NamedTuple

from haptic_device.os_errors import naming

NONE = 1e-9  # [m] of overlap that is rounding
KEPT = Path(__file__).with_suffix(".csv")


class Measured(NamedTuple):
    """A method on a scene. `error` is relative to the way that the bodies come, root mean square over time.

    `doubt` is how far the reference may be off, in the same measure; `created` the energy created over the largest
    about, nan where motors or belts give some; `exchange_us` the median processor time of an exchange of 1 ms. What a
    method cannot do is nan.
    """

    scene: str
    method: str
    step_us: float
    error: float
    doubt: float
    created: float
    overlap_m: float
    exchange_us: float
    status: str
    """stable, unstable, or why it could not be done."""


def read(path: Path = KEPT) -> list[Measured]:
    """The rows of a table; none if there is no such file. ValueError, one sentence, if it is another one."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    try:
        return [Measured(**{name: kind(row[name]) for name, kind in Measured.__annotations__.items()}) for row in rows]
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"{path} has not the columns {', '.join(Measured._fields)}") from None


def of_scene(name: str) -> list[Measured]:
    """The rows that are kept of a shipped scene."""
    return [row for row in read() if row.scene == name]


def write(rows: list[Measured], path: Path) -> None:
    """Writes a table, in the order of the rows."""
    with naming(path), path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(Measured._fields)
        out.writerows([f"{value:.3g}" if isinstance(value, float) else value for value in row] for row in rows)


def said(row: Measured) -> str:
    """A row in words."""
    if math.isnan(row.error):
        return row.status
    error = f"error {100 * row.error:.2g} %" + (f" (known to {100 * row.doubt:.1g} %)" if row.doubt > row.error else "")
    created = "" if math.isnan(row.created) else f"energy created {100 * row.created:.1g} %, "
    overlap = "no overlap" if row.overlap_m < NONE else f"overlap {row.overlap_m * 1e6:.2g} µm"
    return f"step {row.step_us * 1e-3:g} ms: {error}, {created}{overlap}, {row.exchange_us:.0f} µs an exchange"
