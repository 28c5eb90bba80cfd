# SPDX-License-Identifier: Apache-2.0
"""What either side says in its diagnostics about messages of the other that it refuses."""

from haptic_device.control import exchange_samples

ADVICE = {
    exchange_samples.OTHER_LAYOUT: "both sides must be of the same release",
    exchange_samples.OTHER_METHOD: "set exchange.method alike on driver and simulation",
    exchange_samples.OTHER_GAINS: "the gains differ from those that the driver couples with",
    exchange_samples.SECOND_SENDER: "end one of the two, or give it another namespace",
    exchange_samples.OTHER_NAMES: "the axes, in order, and the tail of docs/reference/topics.md are wanted",
}
ORDINARY = (exchange_samples.REFUSALS[exchange_samples.OLD],)  # late and repeated messages are a network's daily life


class Refusals:
    """Remembers the counts that were looked at last, and speaks of what has come since."""

    def __init__(self, topic):
        self._topic, self._known = topic, {}

    def sentence(self, counts):
        """Sentence about the reason {reason: count} that grew most since the last call; "" if none did."""
        grown = {reason: count - self._known.get(reason, 0) for reason, count in counts.items()}
        self._known = dict(counts)
        worst = max((reason for reason in grown if reason not in ORDINARY), key=grown.get, default=None)
        if worst is None or grown[worst] <= 0:
            return ""
        advice = ADVICE.get(exchange_samples.REFUSALS.index(worst), "")
        return f"{grown[worst]} {self._topic} messages refused: {worst}" + (f"; {advice}" if advice else "")
