# SPDX-License-Identifier: Apache-2.0
"""A page without nodes: served as the viewer serves it, with news that a test makes up."""

import asyncio
import threading
from dataclasses import asdict

from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load
from haptic_sim.viewer.server import Server
from haptic_sim.viewer.tasks import tasks

OFF = {"state": "off", "share": 0.0, "slow": False}
STATUS = {"nodes": {}, "problem": "", "viewer": {"cpu": 0.0, "pages": 1, "sent": 0}, "guide": OFF}
PERIOD = 0.02  # s between two frames
WORKSPACE = ((-0.12, 0.12), (-0.12, 0.16), (-12.0, 12.0))


class Stage:
    """`asked` is what the page has asked for, in order; all of it is answered as done."""

    def __init__(self, scenes):
        self.asked, self.scenes, self._scene, self._frame = [], scenes, None, None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.server = Server("127.0.0.1", 0, self._welcome, self._do, None)
        asyncio.run_coroutine_threadsafe(self.server.start(), self._loop).result(10.0)
        self.address = self.server.address(True)
        self._loop.call_soon_threadsafe(self._repeat)

    def scene(self, name, **frame):
        """The scene at its start, and a frame of it; `frame` replaces parts of it."""
        scene = load(name)
        self._scene = asdict(drawing_of(scene))
        poses = [list(solid["pose"]) for solid in self._scene["solids"]]
        self._frame = {
            "time": 0.0,
            "handle": poses[0],
            "target": poses[0],
            "tool": poses[0],
            "coupled": True,
            "bodies": poses[1:],
            "contacts": [],
            "force": [0.0, 0.0, 0.0],
            "felt": [0.0, 0.0, 0.0],
            "energy": [0.0, 0.0],
            "results": [0.0] * len(scene.measure),
            **frame,
        }
        self.tell("scene", self._scene)

    def show(self, **changes):
        """The frame again, with these changes."""
        self._frame = {**self._frame, **changes}

    def _repeat(self):
        if self._frame:
            self.server.show(self._frame)
        self._loop.call_later(PERIOD, self._repeat)

    def tell(self, kind, content):
        """News for the page."""
        self._loop.call_soon_threadsafe(self.server.tell, kind, content)

    def guide(self, **changes):
        """What the viewer says of the guide."""
        self.tell("status", STATUS | {"guide": OFF | changes})

    def close(self):
        asyncio.run_coroutine_threadsafe(self.server.stop(), self._loop).result(10.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10.0)

    def _welcome(self, session):
        hello = {"control": True, "declarations": [], "scenes": self.scenes, "tasks": tasks(), "methods": ["auto"]}
        session.tell("hello", hello | {"looking": ""})
        session.tell(
            "values", {"values": {}, "offer": {}, "began": {}, "passive": {}, "workspace": WORKSPACE, "damping": []}
        )
        session.tell("status", STATUS)

    async def _do(self, message, session):
        self.asked.append(message.model_dump())
        return "done"
