# SPDX-License-Identifier: Apache-2.0
"""The web server: static files, a websocket a page, the operating point as a file. Everything behind a token."""

import asyncio
from importlib.resources import files

from aiohttp import web

from haptic_sim.viewer import door
from haptic_sim.viewer.guard import HEADERS, Guard, reachable
from haptic_sim.viewer.seat import Seat, encoded
from haptic_sim.viewer.wishes import LONGEST

WEB = files("haptic_sim.viewer") / "web"
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
MOST_PAGES = 16


class Server:
    """welcome(seat) tells a page that has come what there is; do(wish, seat) does what it asks for; save() is the file
    of the operating point."""

    def __init__(self, host: str, port: int, welcome, do, save):
        self.guard, self.seats = Guard(host), []
        self._host, self._port, self._welcome, self._do, self._save = host, port, welcome, do, save
        self._runner = self._listener = self._door = None

    async def start(self) -> None:
        """Listens. OSError if the address is taken."""
        app = web.Application(middlewares=[self._guarded])
        app.router.add_get("/{token}/socket", self._open_socket)
        app.router.add_get("/{token}/operating_point.yaml", self._operating_point)
        app.router.add_get("/{token}/{name:[a-z_]{0,40}(?:\\.[a-z]{1,4})?}", self._file)
        app.router.add_get("/{rest:.*}", self._nothing)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0, keepalive_timeout=door.HANDSHAKE)
        await self._runner.setup()
        self._door = door.Door(self._runner.server)
        self._listener = await asyncio.get_running_loop().create_server(self._door, self._host, self._port)
        self._port = self._listener.sockets[0].getsockname()[1]

    async def stop(self) -> None:
        """Closes all pages' connections."""
        if self._listener is not None:
            self._listener.close()
        if self._runner is not None:
            await self._runner.cleanup()

    def address(self, control: bool) -> str:
        """Where a page with control, or one that only looks on, is found."""
        host = reachable(self._host)
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self._port}/{self.guard.control if control else self.guard.look}/"

    def tell(self, kind: str, content) -> None:
        """News for all pages."""
        for seat in self.seats:
            seat.tell(kind, content)

    def show(self, frame: dict) -> None:
        """A frame for all pages that keep up."""
        if self.seats:
            text = encoded(frame)
            for seat in self.seats:
                seat.show(text)

    @web.middleware
    async def _guarded(self, request, handler):
        self._door.heard(request.transport)
        try:
            self.guard.check_host(request.headers.get("Host", ""))
            self.guard.may_control(_token(request))
        except PermissionError as refusal:
            return web.Response(status=403, text=f"{refusal}\n", headers=HEADERS)
        answer = await handler(request)
        if not answer.prepared:
            answer.headers.update(HEADERS)
        return answer

    async def _file(self, request):
        name = request.match_info["name"] or "index.html"
        path = WEB / name
        kind = TYPES.get("." + name.rsplit(".", 1)[-1])
        if kind is None or not path.is_file():
            return await self._nothing(request)
        return web.Response(body=path.read_bytes(), content_type=kind, charset="utf-8")

    async def _nothing(self, request):
        return web.Response(status=404, text=f"there is nothing called {request.path.rsplit('/', 1)[-1]}\n")

    async def _operating_point(self, request):
        headers = {"Content-Disposition": 'attachment; filename="operating_point.yaml"'}
        return web.Response(text=self._save(), content_type="application/yaml", headers=headers)

    async def _open_socket(self, request):
        try:
            self.guard.check_origin(request.headers.get("Origin"), request.headers.get("Host", ""))
        except PermissionError as refusal:
            return web.Response(status=403, text=f"{refusal}\n")
        control = self.guard.may_control(_token(request))
        if sum(seat.control == control for seat in self.seats) >= MOST_PAGES:
            return web.Response(status=503, text=f"{MOST_PAGES} pages are open already\n")
        socket = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=5.0, compress=False)
        await socket.prepare(request)
        seat = Seat(socket, control, self._do)
        self.seats.append(seat)
        try:
            self._welcome(seat)
            await seat.serve()
        finally:
            self.seats.remove(seat)
        return socket


def _token(request):
    return (request.path.split("/") + [""])[1]
