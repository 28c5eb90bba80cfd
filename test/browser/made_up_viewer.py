# SPDX-License-Identifier: Apache-2.0
"""The viewer's server without nodes: a test says what pages are told, and reads what they ask for."""

import asyncio
import itertools
import threading
import time
from dataclasses import asdict

from haptic_display.page import settings
from haptic_display.page.server import Server
from haptic_display.page.tasks import tasks
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load

PERIOD = 0.02  # s between two frames
LIMIT = 30.0  # s for what the server does
FRAME = {
    "handle": [0.0, 0.0, 0.0],
    "target": [0.0, 0.0, 0.0],
    "tool": [0.0, 0.0, 0.0],
    "coupled": True,
    "bodies": [],
    "contacts": [],
    "force": [0.0, 0.0, 0.0],
    "felt": [0.0, 0.0, 0.0],
    "energy": [0.0, 0.0],
    "results": [],
}
HELLO = {
    "declarations": settings.declarations(),
    "scenes": ["peg_in_hole", "wall"],
    "tasks": tasks(),
    "methods": ["auto", "partitioned"],
}
VALUES = {
    "values": {},
    "offer": {},
    "began": {},
    "passive": {},
    "workspace": [[-0.12, 0.12], [-0.1, 0.1], [-1.5, 1.5]],
    "device": "made up",
    "damping": [4.0, 4.0, 0.002],
}
STATUS = {"nodes": {}, "problem": "", "viewer": {"cpu": 0.07, "pages": 1, "sent": 60.0}}


class MadeUpViewer:
    """Serves pages until close(). What cannot be served raises at once, as Server.start does.

    news: what pages are told by kind, in place of HELLO, no scene, VALUES and STATUS. asked: what they asked for, as
    dictionaries, oldest first. do(message) and load(file) answer with a sentence, ValueError refuses.
    """

    def __init__(self, port=0, do=lambda message: "done", load=None, **news):
        self.asked = []
        self._news = {"hello": HELLO, "scene": None, "values": VALUES, "status": STATUS} | news
        self._do, self._load, self._frame, self._forces = do, load, None, itertools.count(1)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._server = Server("127.0.0.1", port, self._welcome, self._answer, load=self._take)
        try:
            self._run(self._server.start())
        except ValueError:
            self.close()
            raise
        self.address, self.looking = self._server.address(True), self._server.address(False)
        self._loop.call_soon_threadsafe(self._repeat)

    def tell(self, kind, content):
        """News for all pages; of what pages are told to begin with, also for those that come."""
        if kind in self._news:
            self._news[kind] = content
        self._loop.call_soon_threadsafe(self._server.tell, kind, content)

    def show(self, **changed):
        """From now on frames come, and have this."""
        self._frame = (self._frame or FRAME) | changed

    def show_drawn(self, tab, **changed):
        """Waits until this page has drawn a frame with this: the force of each is another [N]."""
        newton = next(self._forces)
        self.show(felt=[float(newton), 0.0, 0.0], **changed)
        tab.until(f"parseFloat(document.getElementById('force').textContent) === {newton}")

    def show_scene(self, name, **changed):
        """This scene, with frames of its start that have this."""
        scene = load(name)
        tool, bodies = list(scene.tool.pose), [list(body.pose) for body in scene.bodies]
        at = {"handle": tool, "target": tool, "tool": tool, "bodies": bodies, "results": [0.0] * len(scene.measure)}
        self._frame = FRAME | at | changed
        self.tell("scene", asdict(drawing_of(scene)))

    def close(self):
        """No page is served any more."""
        self._run(self._server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(LIMIT)

    def _run(self, work):
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(LIMIT)

    def _repeat(self):
        if self._frame:
            self._server.show({"time": time.monotonic()} | self._frame)
        self._loop.call_later(PERIOD, self._repeat)

    def _welcome(self, page):
        hello = self._news["hello"] | {"control": page.control, "looking": self.looking}
        for kind, content in (self._news | {"hello": hello}).items():
            page.tell(kind, content)

    async def _answer(self, message, page):
        self.asked.append(message.model_dump(exclude_unset=True) | {"do": message.do})
        sentence = self._do(message)
        await asyncio.sleep(0.0)  # what was told meanwhile goes ahead of the answer
        return sentence

    async def _take(self, file):
        return self._load(file)
