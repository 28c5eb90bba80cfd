# SPDX-License-Identifier: Apache-2.0
"""The viewer's server without nodes: the test says what pages are told, and reads what they ask for."""

import asyncio
import threading

from haptic_sim.viewer.server import Server

FRAME = {
    "time": 0.0,
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
WORKSPACE = ((-0.12, 0.12), (-0.1, 0.1), (-1.5, 1.5))
VALUES = {"values": {}, "offer": {}, "walls": [], "workspace": WORKSPACE, "device": None, "damping": []}
STATUS = {"nodes": {}, "problem": "", "viewer": {"cpu": 0.0, "pages": 1, "sent": 0.0}}


class MadeUpViewer:
    """`asked`: what pages asked for, as dictionaries, oldest first; what they are answered is "done"."""

    def __init__(self):
        self.asked, self._loop = [], asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._server = self._live(self._serve())
        self.address, self.looking = self._server.address(True), self._server.address(False)

    def tell(self, kind, content):
        """News for all pages."""
        self._loop.call_soon_threadsafe(self._server.tell, kind, content)

    def show(self, **changed):
        """A frame for all pages, with this changed."""
        self._loop.call_soon_threadsafe(self._server.show, FRAME | changed)

    def places(self):
        """The places that the hand was asked to go to."""
        return [one for one in self.asked if one["do"] == "aim"]

    def close(self):
        """No page is served any more."""
        self._live(self._server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10.0)

    def _live(self, doing):
        return asyncio.run_coroutine_threadsafe(doing, self._loop).result(30.0)

    async def _serve(self):
        server = Server("127.0.0.1", 0, self._welcome, self._do)
        await server.start()
        return server

    async def _do(self, message, page):
        self.asked.append(message.model_dump(exclude_unset=True) | {"do": message.do})
        return "done"

    def _welcome(self, page):
        hello = {"control": page.control, "declarations": [], "scenes": ["one", "two"], "methods": ["auto"]}
        page.tell("hello", hello | {"looking": self.looking})
        for kind, content in (("scene", None), ("values", VALUES), ("status", STATUS)):
            page.tell(kind, content)
