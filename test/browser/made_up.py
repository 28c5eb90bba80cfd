# SPDX-License-Identifier: Apache-2.0
"""A page before a server with made-up news and no nodes: what is only the page's own logic and looks."""

import asyncio
import contextlib
import copy
import threading
import time
from dataclasses import asdict

from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load
from haptic_sim.viewer import settings
from haptic_sim.viewer.server import Server

PERIOD = 0.05  # s between two frames
DRIVER = {
    "state": "engaged",
    "fault": "",
    "withheld": "",
    "passivity_margin": "2.4",
    "passivity_margin_theta": "0.0008",
    "lateness_us_p50": "60.4",
    "lateness_us_p99": "151",
    "lateness_us_p999": "300",
    "lateness_us_max": "1200",
    "age_ms_p50": "1.1",
    "age_ms_p99": "2.3",
    "window_s": "5.0",
    "missed": "3",
    "ticks": "40000",
    "exchange_method": "pspm",
    "exchange_answered": "9998",
    "exchange_sent": "10000",
}
NODES = {
    "haptic_driver": {"level": 0, "message": "engaged", "values": DRIVER},
    "haptic_recorder": {"level": 0, "message": "idle", "values": {}},
    "haptic_simulation": {"level": 1, "message": "Simulation paused once: handle data was late.", "values": {}},
}
WAITING = "force withheld for 2 s (waiting): lead the handle to the tool"
WITHHELD = {"level": 1, "message": WAITING, "values": {**DRIVER, "withheld": "waiting"}}
FAULT = {"level": 2, "message": "fault: estop", "values": {**DRIVER, "state": "fault", "fault": "estop"}}
WALLS = {"normals": [0.0, 1.0, 1.0, 0.0], "offsets": [-0.03, -0.08], "stiffness": [100.0, 50.0], "damping": [0.1, 0.1]}
ONE = {"unit": "ms", "low": 0, "high": 200}
OFFER = {"exchange.method": {"value": "pspm", "choices": ["direct", "pspm", "wave"]}, "delay": {"value": 0.0, **ONE}}


class MadeUp:
    """Serves until close(); `nodes` is what the status tells, `walls` its walls, `asked` what pages asked for."""

    def __init__(self, port=0):
        self.nodes, self.walls, self.asked = copy.deepcopy(NODES), {}, []
        self._port, self._over, self._ready = port, False, threading.Event()
        self._scene = load("peg_in_hole")
        self._drawn = asdict(drawing_of(self._scene))
        self._thread = threading.Thread(target=lambda: asyncio.run(self._live()), daemon=True)
        self._thread.start()
        self._ready.wait()

    def close(self):
        self._over = True
        self._thread.join()

    async def _live(self):
        server = Server("127.0.0.1", self._port, self._welcome, self._do)
        await server.start()
        self.address, self.looking = server.address(True), server.address(False)
        self._ready.set()
        while not self._over:
            server.tell("status", self._status())
            server.tell("values", self._values())
            server.show(self._frame())
            await asyncio.sleep(PERIOD)
        with contextlib.suppress(asyncio.CancelledError):
            await server.stop()

    def _welcome(self, session):
        hello = {"control": session.control, "declarations": settings.declarations(), "scenes": ["peg_in_hole", "wall"]}
        session.tell("hello", {**hello, "methods": ["auto", "partitioned"], "looking": self.looking})
        session.tell("scene", self._drawn)
        session.tell("values", self._values())

    async def _do(self, message, session):
        self.asked.append(message)
        return "done"

    def _status(self):
        return {"nodes": self.nodes, "problem": "", "viewer": {"cpu": 0.07, "pages": 1, "sent": 60.0}}

    def _values(self):
        live = {name: parameter.default for name, parameter in settings.LIVE.items()}
        live |= {f"wall.{name}": value for name, value in self.walls.items()} | {"exchange.method": "pspm"}
        return {
            "values": {"haptic_driver": live, "haptic_simulation": {"scene": "peg_in_hole", "method": "auto"}},
            "offer": OFFER,
            "walls": settings.walls(live),
            "workspace": [[-0.12, 0.12], [-0.12, 0.12], [-1.5, 1.5]],
            "device": "reference",
            "damping": [4.0, 4.0, 0.002],
        }

    def _frame(self):
        tool = self._scene.tool.pose
        handle = [tool[0], tool[1] - 0.004, tool[2]]
        return {
            "time": time.monotonic(),
            "handle": handle,
            "target": [handle[0], handle[1] - 0.01, handle[2]],
            "tool": list(tool),
            "coupled": True,
            "bodies": [list(body.pose) for body in self._scene.bodies],
            "contacts": [[0, 0, 0.0101, -0.001, 1, 0, 2.0, 1.0, 0]],
            "force": [1.2, 4.8, 0.01],
            "felt": [1.1, 4.9, 0.01],
            "energy": [0.002, -0.001],
            "results": [0.42] * len(self._scene.measure),
        }
