# SPDX-License-Identifier: Apache-2.0
"""How long nodes are waited for: as long as there is news of them, for a busy machine takes its time.

News is what was never there before: a node that is heard of, its level, its state, its words, a last line that it
printed. Numbers in words are none, lest a count that grows be waited for without end.
"""

import re
import time

from haptic_device import ros_environment
from haptic_sim.scene.needs import TOGETHER

LIMIT = 2.0 * TOGETHER  # [s] without news
UNSERVED = 10.0  # [s] likewise, where nodes that print are not heard of, and only a discovery server lets them be


class News:
    """What a client hears of these nodes. moving: the time on the device's own clock is news too, as it goes on."""

    def __init__(self, client, *nodes: str, moving: bool = False):
        self._client, self._nodes, self._moving = client, nodes, moving
        self._known, self._printed, self._newest, self._moved = set(), {}, time.monotonic(), 0.0

    def ended(self, printed: dict[str, str]) -> bool:
        """Whether there has been no news for LIMIT. printed: last line of each node whose log is at hand."""
        self._printed, now = printed, time.monotonic()
        if self._moves() or not self._facts() <= self._known:
            self._known |= self._facts()
            self._newest = now
        return now - self._newest >= self._limit()

    def last_words(self) -> str:
        """That there was no news, for how long, and what each node said last."""
        why = f"{ros_environment.discovery()}; " if self._unheard() else ""
        return f"no news for {self._limit():g} s: {why}{'; '.join(map(self._last_word, self._nodes))}"

    def _limit(self):
        return UNSERVED if self._unheard() else LIMIT

    def _unheard(self):
        return ros_environment.discovery() and not self._client.statuses

    def _facts(self):
        said = self._client.statuses.items()
        facts = {(name, one.level, one.values.get("state"), _words(one.message)) for name, one in said}
        facts |= {(name, _words(line)) for name, line in self._printed.items()}
        return facts | ({"truth"} if self._client.truth else set())

    def _moves(self):
        before, self._moved = self._moved, self._client.truth.get("time", (0.0,))[0]
        return self._moving and self._moved > before

    def _last_word(self, name):
        if name in self._client.statuses:
            return f"{name} says: {self._client.statuses[name].message}"
        printed = f", which printed last: {self._printed[name]}" if name in self._printed else ""
        return f"nothing was heard of {name}{printed}"


def _words(text):
    return re.sub(r"\d+", "", text)
