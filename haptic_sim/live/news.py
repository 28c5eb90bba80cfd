# SPDX-License-Identifier: Apache-2.0
"""How long nodes are waited for: as long as there is news of them, for a busy machine takes its time.

News is what was never there before: a node that is heard of, its level, its state, its words, a last line that it
printed. Numbers in words are none, lest a count that grows be waited for without end.
"""

import re
import time

LIMIT = 90.0  # [s] without news; a driver waits half of it for its simulation before it enables by itself


class News:
    """What a client hears of these nodes. moving: the time on the device's own clock is news too, as it goes on."""

    def __init__(self, client, *nodes: str, moving: bool = False):
        self._client, self._nodes, self._moving = client, nodes, moving
        self._known, self._printed, self._newest = set(), {}, time.monotonic()

    def ended(self, printed: dict[str, str]) -> bool:
        """Whether there has been no news for LIMIT. printed: last line of each node whose log is at hand."""
        self._printed, now = printed, time.monotonic()
        if new := self._facts() - self._known:
            self._known, self._newest = self._known | new, now
        return now - self._newest >= LIMIT

    def last_words(self) -> str:
        """What each node said last."""
        return "; ".join(map(self._last_word, self._nodes))

    def _facts(self):
        said = self._client.statuses.items()
        facts = {(name, one.level, one.values.get("state"), re.sub(r"\d+", "", one.message)) for name, one in said}
        truth = self._client.truth
        facts |= {("truth", truth["time"][0] if self._moving else 0.0)} if "time" in truth else set()
        return facts | set(self._printed.items())

    def _last_word(self, name):
        if name in self._client.statuses:
            return f"{name} says: {self._client.statuses[name].message}"
        printed = f", which printed last: {self._printed[name]}" if name in self._printed else ""
        return f"nothing was heard of {name}{printed}"
