# SPDX-License-Identifier: Apache-2.0
"""The session of one page: what it is sent, and what it asks for. Frames are dropped for it, never queued."""

import asyncio
import itertools
import json
import math
import time
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from aiohttp import WSMsgType, web

from haptic_device.os_errors import in_words
from haptic_display.page.messages import Aim, Message, Seen, Trigger, parse

MOST_PER_SECOND = 300  # messages that are taken
BURST = 150  # messages beyond that
UNSEEN = 3  # frames on their way to a page that has not said that it has seen them
GIVEN_UP = 1.0  # s after which frames go out again to a page that says nothing: hidden tabs do not draw
HINT_PERIOD = 1.0  # s between two hints
LAP = 50  # messages between two turns of the event loop: those that wait already come without one
MOST_BUSY = 32  # things that a page has asked for and that are not done
MOST_ANSWERS = 64  # kept for a page that takes none; the oldest go
ANSWER = "answer "  # kind of news, followed by a number: none takes another's place
MOST_STOPS = 4  # that a page has asked for and that are not done; all further ones are one more
STOP = Trigger(service="estop")  # no page is refused it, of whatever it has had enough
STOPPING = '"estop"'  # is in every message that stops
Do = Callable[[Message, "Session"], Awaitable[str]]
"""Does what a page asks for, and says what was done; ValueError to refuse."""


class Session:
    """`sent`, `seen` and `dropped` count frames, `heard` the page's messages."""

    def __init__(self, socket: web.WebSocketResponse, control: bool, do: Do):
        self.control, self._socket, self._do = control, socket, do
        self.sent = self.seen = self.dropped = self.heard = 0
        self._news: dict[str, Any] = {}
        self._frame: str | None = None
        self._wake = asyncio.Event()
        self._last_seen, self._hinted = time.monotonic(), -HINT_PERIOD
        self._busy: set[asyncio.Task[None]] = set()
        self._stops, self._stop_again = 0, False
        self._numbers = itertools.count()

    def tell(self, kind: str, content: object) -> None:
        """News of a kind: a newer one takes the place of one that has not been sent."""
        self._news[kind] = content
        answers = [known for known in self._news if known.startswith(ANSWER)]
        for oldest in answers[:-MOST_ANSWERS]:
            del self._news[oldest]
        self._wake.set()

    def show(self, frame: str) -> None:
        """A frame, if the page keeps up."""
        waiting = self.sent - self.seen >= UNSEEN
        if self._frame is not None or (waiting and time.monotonic() < self._last_seen + GIVEN_UP):
            self.dropped += 1
            return
        self._last_seen = time.monotonic() if waiting else self._last_seen
        self._frame = frame
        self._wake.set()

    async def serve(self) -> None:
        """Until the page goes."""
        sending = asyncio.create_task(self._send())
        try:
            await self._receive()
        finally:
            sending.cancel()  # what the page asked for goes on: nodes that are started again, an e-stop above all

    async def _send(self) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            news, self._news = self._news, {}
            try:
                for kind, content in news.items():
                    await self._socket.send_str(encoded({"kind": kind, "content": content}))
                if self._frame is not None:
                    frame, self._frame = self._frame, None
                    self.sent += 1
                    await self._socket.send_str(f'{{"kind":"frame","number":{self.sent},"content":{frame}}}')
            except ConnectionError:
                return

    async def _receive(self) -> None:
        rate = RateLimit(time.monotonic())
        async for received in self._socket:
            self.heard += 1
            if self.heard % LAP == 0:
                await asyncio.sleep(0.0)
            if received.type is not WSMsgType.TEXT:
                self._hint("a message is not text")
            else:
                self._take(received.data, not rate.allows(time.monotonic()))

    def _take(self, text: str, too_many: bool) -> None:
        try:
            message = parse(text) if STOPPING in text or not too_many else None
            if message is None or (too_many and message != STOP):
                raise ValueError(f"more than {MOST_PER_SECOND} messages a second: some are ignored")
            if not self.control and not isinstance(message, Seen) and message != STOP:
                raise ValueError("this page is view-only")
        except ValueError as refusal:
            self._hint(str(refusal))
            return
        if isinstance(message, Seen):
            self.seen, self._last_seen = min(self.sent, max(self.seen, message.frame)), time.monotonic()
            return
        if message == STOP:
            self._stop()
        elif len(self._busy) >= MOST_BUSY:
            self._hint(f"{MOST_BUSY} things are being done already: {message.do} is ignored")
        else:
            self._begin(self._answer(message))

    def _begin(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._busy.add(task)
        task.add_done_callback(self._busy.discard)
        return task

    def _stop(self) -> None:
        """At once; beyond MOST_STOPS as soon as one of those is done, once for all that wait."""
        if self._stops >= MOST_STOPS:
            self._stop_again = True
            return
        self._stops += 1
        self._begin(self._answer(STOP)).add_done_callback(self._stopped)

    def _stopped(self, task: asyncio.Task[None]) -> None:
        self._stops -= 1
        if self._stop_again and not task.cancelled():
            self._stop_again = False
            self._stop()

    async def _answer(self, message: Message) -> None:
        try:
            sentence, done = await self._do(message, self), True
        except (ValueError, OSError) as refusal:
            sentence, done = in_words(refusal), False
        if not isinstance(message, Aim):
            answer = {"to": message.model_dump(), "done": done, "sentence": sentence}
            self.tell(f"{ANSWER}{next(self._numbers)}", answer)
        elif sentence:
            self._hint(sentence)

    def _hint(self, sentence: str) -> None:
        if time.monotonic() > self._hinted + HINT_PERIOD:
            self._hinted = time.monotonic()
            self.tell("hint", sentence)


class RateLimit:
    """Of the messages of one page: MOST_PER_SECOND, and a short burst. now [s]."""

    def __init__(self, now: float):
        self._left, self._at = float(BURST), now

    def allows(self, now: float) -> bool:
        """Whether one more message at this time [s] is taken."""
        self._left = min(BURST, self._left + (now - self._at) * MOST_PER_SECOND)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def encoded(content: object) -> str:
    """JSON, which has no infinity: a number that is none becomes null."""
    try:
        return json.dumps(content, allow_nan=False)
    except ValueError:
        return json.dumps(_known(content))


def _known(content: Any) -> Any:
    if isinstance(content, dict):
        return {name: _known(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return [_known(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
