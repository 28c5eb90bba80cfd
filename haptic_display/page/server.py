# SPDX-License-Identifier: Apache-2.0
"""The web server: static files, a websocket a page, the operating point as a file. Everything behind a token."""

import asyncio
import errno
import logging
import os
import socket
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from haptic_device.os_errors import in_words
from haptic_display.page.guard import ALONE, HEADERS, Guard, is_loopback, reachable
from haptic_display.page.kept_tokens import kept
from haptic_display.page.loading import LARGEST
from haptic_display.page.messages import LONGEST
from haptic_display.page.session import Do, Session, encoded
from haptic_sim.node.parameters import HOME_PORT

WEB = Path(__file__).with_name("web")
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}  # on any machine
MOST_PAGES = 16
PORTS = 16  # tried from HOME_PORT on
MOST_CONNECTIONS = 64  # of one address: more than all pages there can be, and what their browsers fetch
HANDSHAKE = 10.0  # s for a first request, and from one request to the next
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]
Welcome = Callable[[Session], None]
Asked = Callable[..., Awaitable[Any]]  # save() → str, load(file: bytes) → str, film(name: str) → bytes


async def none(*asked: object) -> Any:
    """What a server without files and films has of them."""
    raise ValueError("this server has nothing of the kind")


class Server:
    """welcome(session) tells a page that has come what there is; do(message, session) does what it asks for; save() is
    the file of the operating point, load(file) takes such a file and gives the sentence that says what it has set;
    film(name) is the page that plays a recording, as Recordings.film. notes: sentences on its addresses, once it has
    started."""

    def __init__(
        self, host: str, port: int, welcome: Welcome, do: Do, save: Asked = none, load: Asked = none, film: Asked = none
    ):
        self.guard = Guard(host)
        self.sessions: list[Session] = []
        self.notes: list[str] = []
        self._host, self._port, self._welcome, self._do, self._save = host, port, welcome, do, save
        self._load, self._film = load, film
        self._files = {path.name: path for path in WEB.iterdir() if path.suffix in TYPES}  # all that can be fetched
        self._runner: web.AppRunner | None = None
        self._listener: asyncio.Server | None = None
        self._limit: ConnectionLimit  # once it has started

    async def start(self) -> None:
        """Listens. ValueError, one sentence, if the address is taken or there is none of this name.

        On this machine alone, and on the port that was asked for, the links are those of the last time."""
        app = web.Application(middlewares=[self._guarded], client_max_size=LARGEST)
        app.router.add_get("/{token}/socket", self._open_socket)
        app.router.add_get("/{token}/operating_point.yaml", self._operating_point)
        app.router.add_get("/{token}/film.html", self._recording)
        app.router.add_post("/{token}/operating_point.yaml", self._take_operating_point)
        app.router.add_get("/{token}/{name:[^/]*}", self._file)
        log = logging.getLogger(__name__)
        log.addFilter(_worth_a_line)
        runner = web.AppRunner(app, shutdown_timeout=1.0, keepalive_timeout=HANDSHAKE, access_log=None, logger=log)
        self._runner = runner
        await runner.setup()
        assert runner.server is not None  # it is set up
        self._limit = ConnectionLimit(runner.server)
        asked = self._port
        self._port = await self._listen(range(asked, asked + (PORTS if asked == HOME_PORT else 1)))
        if asked not in (0, self._port):
            self.notes.append(f"port {asked} is taken: this page has port {self._port}, and links for this time only")
        elif asked and is_loopback(self._host):
            (self.guard.control, self.guard.look), note = kept()
            self.notes += [note] if note else []

    async def _listen(self, ports: Sequence[int]) -> int:
        """The first of these ports that is free."""
        for port in ports:
            try:
                self._listener = await asyncio.get_running_loop().create_server(self._limit, self._host, port)
                return self._listener.sockets[0].getsockname()[1]
            except OSError as error:  # its text is that of the library, for a taken port with a number in brackets
                if error.errno == errno.EADDRINUSE and port != ports[-1]:
                    continue
                why = error.strerror if isinstance(error, socket.gaierror) else os.strerror(error.errno or 0)
                raise ValueError(f"no page can be served on host {self._host!r}, port {port}: {why}") from None
        raise ValueError(f"no page can be served on host {self._host!r} without a port")

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

    def tell(self, kind: str, content: object) -> None:
        """News for all pages."""
        for session in self.sessions:
            session.tell(kind, content)

    def show(self, frame: dict[str, Any]) -> None:
        """A frame for all pages that keep up."""
        if self.sessions:
            text = encoded(frame)
            for session in self.sessions:
                session.show(text)

    @web.middleware
    async def _guarded(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        self._limit.heard(request.transport)
        try:
            answer = await self._admitted(request, handler)
        except PermissionError as refusal:
            answer = web.Response(status=403, text=f"{refusal}\n")
        except web.HTTPException as refusal:
            refusal.headers.update(HEADERS)
            raise
        if not answer.prepared:
            for name, value in HEADERS.items():
                answer.headers.setdefault(name, value)
        return answer

    async def _admitted(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        self.guard.check_host(request.headers.get("Host", ""))
        self.guard.may_control(_token(request))
        return await handler(request)

    async def _file(self, request: web.Request) -> web.FileResponse:
        path = self._files.get(request.match_info["name"] or "index.html")
        if path is None:
            raise web.HTTPNotFound(text=f"there is nothing called {request.match_info['name']}\n")
        return web.FileResponse(path, headers={"Content-Type": f"{TYPES[path.suffix]}; charset=utf-8"})

    async def _recording(self, request: web.Request) -> web.Response:
        """Also for a page that looks on only: it changes nothing that moves."""
        try:
            page = await self._film(request.query.get("bag", ""))
        except LookupError as error:
            raise web.HTTPNotFound(text=f"{error.args[0]}\n") from None
        except ValueError as error:
            raise web.HTTPServiceUnavailable(text=f"{error}\n") from None
        return web.Response(body=page, headers=ALONE | {"Content-Type": "text/html; charset=utf-8"})

    async def _operating_point(self, request: web.Request) -> web.Response:
        headers = {"Content-Disposition": 'attachment; filename="operating_point.yaml"'}
        try:
            text = await self._save()
        except ValueError as error:
            raise web.HTTPServiceUnavailable(text=f"nothing is saved: {error}\n") from None
        return web.Response(text=text, content_type="application/yaml", headers=headers)

    async def _take_operating_point(self, request: web.Request) -> web.Response:
        self.guard.check_origin(request.headers.get("Origin"), request.headers.get("Host", ""))
        if not self.guard.may_control(_token(request)):
            raise PermissionError("this page only looks on")
        try:
            return web.Response(text=await self._load(await request.read()))
        except web.HTTPRequestEntityTooLarge:
            refusal = f"the file has more than {LARGEST // 1024} kB"
        except (ValueError, OSError) as error:
            refusal = in_words(error)
        return web.Response(status=400, text=refusal)

    async def _open_socket(self, request: web.Request) -> web.StreamResponse:
        self.guard.check_origin(request.headers.get("Origin"), request.headers.get("Host", ""))
        control = self.guard.may_control(_token(request))
        if sum(session.control == control for session in self.sessions) >= MOST_PAGES:
            return web.Response(status=503, text=f"{MOST_PAGES} pages are open already\n")
        socket = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=5.0, compress=False)
        await socket.prepare(request)
        session = Session(socket, control, self._do)
        self.sessions.append(session)
        try:
            self._welcome(session)
            await session.serve()
        finally:
            self.sessions.remove(session)
        return socket


class ConnectionLimit:
    """How many connections an address may have, and how long one may ask for nothing. Called, makes the protocol of a
    new connection; inside() makes the one that serves those that are let in."""

    def __init__(self, inside: Callable[[], asyncio.Protocol]):
        self._inside, self._waiting = inside, dict[asyncio.Transport, asyncio.TimerHandle]()

    def __call__(self) -> asyncio.Protocol:
        return _Entrance(self)

    def admit(self, transport: asyncio.Transport) -> None:
        """Serves a connection, or breaks it off: at once if its address has enough, later if it asks for nothing."""
        self._waiting = {one: timer for one, timer in self._waiting.items() if not one.is_closing()}
        if sum(_address(one) == _address(transport) for one in self._waiting) >= MOST_CONNECTIONS:
            transport.abort()
            return
        self._waiting[transport] = asyncio.get_running_loop().call_later(HANDSHAKE, transport.abort)
        protocol = self._inside()
        transport.set_protocol(protocol)
        protocol.connection_made(transport)

    def heard(self, transport: asyncio.Transport | None) -> None:
        """A request has come: what is asked for afterwards has the server's own time-out."""
        if transport in self._waiting:
            self._waiting[transport].cancel()


class _Entrance(asyncio.Protocol):
    def __init__(self, limit: ConnectionLimit):
        self._limit = limit

    def connection_made(self, transport: Any) -> None:
        self._limit.admit(transport)


def _worth_a_line(record: logging.LogRecord) -> bool:
    """Of what goes wrong with a request one sentence is logged, no traceback; of a browser that goes away or asks for
    what is no request nothing is."""
    error, record.exc_info = (record.exc_info or (None, None))[1], None
    if error is not None:
        said = str(error).partition("\n")[0]
        record.msg, record.args = f"haptic_viewer: a request failed: {type(error).__name__}: {said}", ()
    return not isinstance(error, ConnectionError | HttpProcessingError) and str(error) != "Transport is closing"


def _token(request: web.Request) -> str:
    return (request.path.split("/") + [""])[1]


def _address(transport: asyncio.Transport) -> str:
    return transport.get_extra_info("peername")[0]
