# SPDX-License-Identifier: Apache-2.0
"""For how long each cause of control/withheld stands, over consecutive rows of the trace."""

import numpy as np
import numpy.typing as npt

from haptic_device.control.withheld import TABLE

LASTS = 0.2  # [s] beyond which a cause counts
BREAK = 0.02  # [s] without it that end it: a handle that moves pays for a tick now and then
SHORT = "the tool's port keeps its force short, for want of energy or by its limit, and the hand feels as little"
"""What the simulation withholds, named tool_port beside the causes of the driver."""
_SECOND = 1e-9


class _Spans:
    """The spans of one cause; times [ns] of the ticks' deadlines."""

    def __init__(self) -> None:
        self._begin = self._last = self._ended = 0.0
        self._free = -np.inf  # the last tick without it
        self.longest = 0.0

    def add(self, times: npt.NDArray[np.float64], on: npt.NDArray[np.bool_]) -> None:
        """The next ticks, and in which of them it was on."""
        edges = np.flatnonzero(np.diff(on, prepend=False, append=False))
        for first, end in edges.reshape(-1, 2):
            # missed ticks are no break
            free = times[first - 1] if first else self._free
            if self._last == 0.0 or free - self._last > BREAK / _SECOND:
                self._close()
                self._begin = times[first]
            self._last = times[end - 1]
            self.longest = max(self.longest, self.seconds)
        if not on[-1]:
            self._free = times[-1]

    @property
    def seconds(self) -> float:
        """Length [s] of the last span."""
        return (self._last - self._begin) * _SECOND

    @property
    def total(self) -> float:
        """Time [s] of all spans that lasted."""
        return self._ended + (self.seconds if self.seconds > LASTS else 0.0)

    @property
    def over(self) -> bool:
        """Whether the last span has ended by the last tick."""
        return self._free - self._last > BREAK / _SECOND

    def _close(self) -> None:
        self._ended, self._begin = self.total, self._last


class WithheldTime:
    """Takes the ticks as they come; a cause lasts once it stood for more than LASTS without a BREAK."""

    def __init__(self) -> None:
        self._spans = {cause.name: _Spans() for cause in TABLE}

    def add(self, times: npt.NDArray[np.float64], bits: npt.NDArray[np.float64]) -> None:
        """The next ticks: deadlines [ns] and column `withheld`."""
        if not len(times):
            return
        whole = np.nan_to_num(bits).astype(np.int64)
        for cause in TABLE:
            self._spans[cause.name].add(times, (whole & cause.bit) != 0)

    def standing(self) -> dict[str, float]:
        """{name: time [s] it has stood} of the causes that last now, in the order of the table."""
        return {name: span.seconds for name, span in self._spans.items() if span.seconds > LASTS and not span.over}

    def totals(self) -> dict[str, tuple[float, float]]:
        """{name: time [s] in all, longest [s]} of the causes that have lasted."""
        return {name: (span.total, span.longest) for name, span in self._spans.items() if span.total > 0.0}
