# SPDX-License-Identifier: Apache-2.0
"""Messages that never came, by the numbers that their publisher gives them; those of several interleave."""

from dataclasses import dataclass

import numpy as np

UNKNOWN = "unknown, several publishers"
SHARED = ("/diagnostics", "/parameter_events", "/mark", "/tf", "/tf_static")  # ends of topics that several publish


@dataclass
class SequenceGaps:
    """Gaps in the numbers that the publisher of one topic gives its messages.

    Attributes:
        last: the last number; 0 for none yet.
        lost: how many numbers were skipped.
        back: how often a number was not above the one before.

    Examples:
        >>> import numpy as np
        >>> from haptic_device.recording.sequence_gaps import counted
        >>> counted(np.array([1, 2, 5, 6]))  # 3 and 4 are missing
        SequenceGaps(last=6, lost=2, back=0)
    """

    last: int = 0
    lost: int = 0
    back: int = 0

    def count(self, sequence: int) -> None:
        """The next message's number; 0 is none."""
        if 0 < self.last < sequence:
            self.lost += sequence - self.last - 1
        self.back += 0 < sequence <= self.last
        self.last = sequence

    def told(self, topic: str) -> str:
        """How many were lost, as text.

        If the numbers go back once, the publisher has restarted. If they go back more often, or if several nodes
        publish, the number of lost messages is unknown.
        """
        several = self.back > 1 or (self.lost > 0 and topic.endswith(SHARED))
        return UNKNOWN if several else str(self.lost)


def counted(sequence: np.ndarray) -> SequenceGaps:
    """`SequenceGaps.count` of all these numbers, at once."""
    steps = np.diff(sequence)
    gaps, back = (steps > 1) & (sequence[:-1] > 0), (steps <= 0) & (sequence[1:] > 0)
    return SequenceGaps(int(sequence[-1]) if len(sequence) else 0, int(np.sum(steps[gaps] - 1)), int(np.sum(back)))
