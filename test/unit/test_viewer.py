# SPDX-License-Identifier: Apache-2.0
"""The viewer's server without nodes and without a browser: who may come in, what may be asked for, what is too much."""

import asyncio
import contextlib
import json
import math
import re
import types
from socket import create_server, gethostname

import aiohttp
import pytest
from hypothesis import example, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from haptic_device.control.controller_config import MOST_WALLS
from haptic_display.page import messages, session, settings
from haptic_display.page import server as server_module
from haptic_display.page.guard import HEADERS, Guard, is_loopback, reachable
from haptic_display.page.loading import LARGEST
from haptic_display.page.server import WEB, Server

pytestmark = pytest.mark.timeout(300)

LIMIT = 120.0  # [s] that anything is waited for
ENABLE, STOP = messages.Trigger(service="enable"), messages.Trigger(service="estop")
MARK = '{"do": "mark", "text": "still there"}'


async def saved():
    return "# saved\n"


async def nothing(*asked):
    raise LookupError(f"there is nothing called {asked}")


def served(visit, do=None, host="127.0.0.1", save=saved, **given):
    """What visit(server, http) returns, with a server on this machine that answers `do`; and what was done."""
    done = []

    async def note(message, page):
        done.append(message)
        return "done"

    async def live():
        welcome = lambda page: page.tell("hello", page.control)  # noqa: E731
        server = Server(host, 0, welcome, do or note, save, **{"film": nothing} | given)
        await server.start()
        async with aiohttp.ClientSession() as http:
            try:
                return await asyncio.wait_for(visit(server, http), LIMIT)
            finally:
                await asyncio.wait_for(server.stop(), LIMIT)

    return asyncio.run(live()), done


def opened(http, server, control=True):
    address = server.address(control)
    return http.ws_connect(address.replace("http", "ws") + "socket", headers={"Origin": address.rsplit("/", 2)[0]})


async def hear(socket, kind):
    """Content of the next news of a kind."""
    while True:
        news = json.loads((await socket.receive(LIMIT)).data)
        if news["kind"].split()[0] == kind:
            return news["content"]


async def knocked(server, said=b""):
    """A connection that has said this; its (reader, writer)."""
    host, port = server.address(True).split("/")[2].split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(said)
    return reader, writer


FILES = [path.name for path in WEB.iterdir()]
WAYS_OUT = ("../viewer.py", "..%2Fviewer.py", "%2E%2E%2Fviewer.py", "..%5Cviewer.py", "/etc/passwd", "%2Fetc%2Fpasswd")
NO_FILES = ("viewer.py", "unknown.js", "web/", "./", "%2E", "film.html?bag=..%2Fone", "a" * 8000, "a" * 9000)
NAMES = st.sampled_from(["", "main.js", "operating_point.yaml", "socket", *WAYS_OUT, *NO_FILES])
VISIBLE = st.text(st.characters(min_codepoint=33, max_codepoint=126), max_size=60)
METHODS = st.sampled_from(["GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "BREW", "get"])
TOKENS = st.sampled_from(["control", "look", "wrong", "", "%C3%A9", "%00"])
HOSTS = st.sampled_from(["127.0.0.1", "LOCALHOST:80", "[::1]", "elsewhere.example", "192.168.1.2", "", "[", ":"])
ORIGINS = st.sampled_from(["own", "http://elsewhere.example", "null", ""])
REQUESTS = st.tuples(METHODS, TOKENS, NAMES | VISIBLE, HOSTS, ORIGINS)
OWN = [("GET", "look", name, "127.0.0.1", "") for name in ("", "main.js", "operating_point.yaml")]
STRANGE = [("GET", "control", name, "127.0.0.1", "") for name in (*WAYS_OUT, *NO_FILES)]
STRANGE += [
    ("POST", "control", "main.js", "127.0.0.1", "own"),
    ("POST", "look", "operating_point.yaml", "[::1]", "own"),
]
STRANGE += [("GET", token, "", "127.0.0.1", "own") for token in ("", "wrong", "%C3%A9")]


def expected(method, token, name, host, origin):
    """ "given", "loaded" or "refused": what an honest doorkeeper does with such a request."""
    path = name.partition("?")[0].partition("#")[0]
    if host not in ("127.0.0.1", "LOCALHOST:80", "[::1]") or token not in ("control", "look"):
        return "refused"
    if method == "POST" and path == "operating_point.yaml" and token == "control" and origin == "own":
        return "loaded"
    return "given" if method in ("GET", "HEAD") and path in ("", "operating_point.yaml", *FILES) else "refused"


@hypothesis_settings(max_examples=8, deadline=None)
@given(st.lists(REQUESTS, min_size=10, max_size=30))
@example(OWN + STRANGE)
@example([("GET", "control", "", host, "") for host in ("elsewhere.example", "192.168.1.2", "", "127.0.0.1")])
@example([("POST", "control", "operating_point.yaml", "127.0.0.1", origin) for origin in ("own", "", "null")])
def test_no_method_token_path_host_or_origin_does_more_than_be_refused_but_the_pages_own(requests):
    loaded = []

    async def load(file):
        loaded.append(file)
        return "loaded"

    async def visit(server, http):
        tokens = {"control": server.guard.control, "look": server.guard.look}
        for method, token, name, host, origin in requests:
            loaded.clear()
            own = f"http://{host}" if origin == "own" else origin
            said = f"{method} /{tokens.get(token, token)}/{name} HTTP/1.1\r\nHost: {host}\r\nOrigin: {own}\r\n"
            reader, writer = await knocked(server, f"{said}Content-Length: 1\r\nConnection: close\r\n\r\n#".encode())
            head, _, body = (await asyncio.wait_for(reader.read(), LIMIT)).decode().partition("\r\n\r\n")
            writer.close()
            status, wanted = int(head.split()[1]), expected(method, token, name, host, origin)
            assert (status == 200) == (wanted != "refused") and (status == 200 or 400 <= status < 500), head
            assert bool(loaded) == (wanted == "loaded") and "Traceback" not in body
            assert status == 400 or all(f"{header}: {value}" in head for header, value in HEADERS.items())

    assert served(visit, load=load)[1] == []


def test_each_file_of_the_page_comes_whole_as_what_it_is_and_fetches_nothing_from_elsewhere():
    types = {"html": "text/html", "js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}

    async def visit(server, http):
        found = {}
        for name in FILES:
            async with http.get(server.address(False) + name) as answer:
                found[name] = (answer.content_type, await answer.read())
        return found

    found = served(visit)[0]
    assert found == {path.name: (types[path.suffix[1:]], path.read_bytes()) for path in WEB.iterdir()} != {}
    for name, (_, content) in found.items():
        text = content.decode()
        assert "https://" not in text, name
        assert [word for word in text.split() if "http://" in word] in ([], ['xmlns="http://www.w3.org/2000/svg"'])


def test_a_socket_is_opened_to_the_servers_own_page_only():
    async def visit(server, http):
        address = server.address(True).replace("http", "ws")
        found = []
        for path in (address + "socket", address[:-6] + "AAAAA/socket"):
            for origin in ({}, {"Origin": "http://elsewhere.example"}, {"Origin": address.rsplit("/", 2)[0]}):
                with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                    await http.ws_connect(path, headers=origin)
                found.append(refusal.value.status)
        return found

    assert served(visit)[0] == [403] * 6


def test_a_file_that_is_sent_or_asked_for_is_loaded_given_or_refused_with_its_sentence():
    async def load(content):
        if content == b"wrong":
            raise ValueError("wrong is no parameter file")
        return f"{len(content)} bytes are loaded"

    async def silent():
        raise ValueError("haptic_driver does not answer")

    async def visit(server, http):
        address, found = f"{server.address(True)}operating_point.yaml", []
        for file in (b"wrong", b"#" * LARGEST, b"#" * (LARGEST + 1)):
            async with http.post(address, data=file, headers={"Origin": address.rsplit("/", 2)[0]}) as answer:
                found.append((answer.status, await answer.text()))
        async with http.get(address) as answer:
            return [*found, (answer.status, await answer.text())]

    assert served(visit, load=load, save=silent)[0] == [
        (400, "wrong is no parameter file"),
        (200, f"{LARGEST} bytes are loaded"),
        (400, "the file has more than 64 kB"),
        (503, "nothing is saved: haptic_driver does not answer\n"),
    ]


def test_a_page_with_control_is_obeyed_and_one_that_is_view_only_may_stop_and_nothing_else():
    async def refuse_stop(message, page):
        asked.append((page.control, message))
        if message == STOP:
            raise ValueError("the driver says no")
        return "done"

    async def visit(server, http):
        said = []
        for control in (True, False):
            async with opened(http, server, control) as socket:
                said.append(await hear(socket, "hello"))
                for text in ('{"do": "trigger", "service": "enable"}', '{"do": "mark", "text": "estop"}', MARK):
                    await socket.send_str(text)
                    said.append(await hear(socket, "answer") if control else "")
                said[-1] = said[-1] or await hear(socket, "hint")
                await socket.send_str(STOP.model_dump_json())
                said.append(await hear(socket, "answer"))
        return said

    asked = []
    (control, enabled, _, _, stopped, looking, _, _, hint, stopped_too), _ = served(visit, refuse_stop)
    assert (control, looking, enabled["done"]) == (True, False, True)
    assert hint == "this page is view-only"
    for answer in (stopped, stopped_too):
        assert (answer["done"], answer["sentence"]) == (False, "the driver says no")
    assert asked[0] == (True, ENABLE) and asked[3:] == [(True, STOP), (False, STOP)]


BAD = (
    '{"do": "aim", "x": NaN}',
    '{"do": "aim", "x": 1e999}',
    '{"do": "aim", "x": true}',
    "{",
    "[]",
    "null",
    "[" * 3000,
    '{"do": ["aim"]}',
    '{"do": "set_all", "values": {}}',
    '{"do": "aim", "x": ' + "9" * 400 + "}",
    '{"do": "set_all", "values": {"a": 1e300}}',
    '{"do": "_prepare"}',
    '{"do": "mark", "text": "' + "a" * 300 + '"}',
)
JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)
MODELS = messages.Message.__subclasses__()
KINDS = st.sampled_from([model.model_fields["do"].default for model in MODELS])
FIELDS = st.dictionaries(st.sampled_from(sorted({name for model in MODELS for name in model.model_fields})), JUNK)


@hypothesis_settings(max_examples=50)
@given(st.text() | st.builds(lambda do, fields: json.dumps(fields | {"do": do}), KINDS | JUNK, FIELDS))
def test_no_text_does_more_than_be_refused_in_one_sentence(text):
    try:
        message = messages.parse(text)
    except ValueError as refusal:
        assert "\n" not in str(refusal) and len(str(refusal)) < 400
    else:
        assert messages.parse(message.model_dump_json(exclude_unset=True)) == message


def test_what_is_malformed_is_refused_in_one_sentence():
    for text in BAD:
        with pytest.raises(ValueError) as refusal:
            messages.parse(text)
        assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 400, text


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ('{"do": "aim", "x": 9007199254740991, "z": 1.0}', messages.Aim(x=9007199254740991.0)),
        ('{"do": "aim", "x": 9007199254740992}', "aim: x is 9007199254740992; a finite number below 2^53 is needed"),
        ('{"do": "aim", "z": 1.0}', "aim names none of x, y, theta"),
        ('{"do": "record", "on": 1}', "record: on is 1; true or false is needed"),
        ('{"do": "mark", "text": "' + 200 * "a" + '"}', messages.Mark(text=200 * "a")),
        ('{"do": "mark", "text": "' + 201 * "a" + '"}', "mark: text has 201 characters; the limit is 200"),
        (
            '{"do": "set_all", "values": {"a": [1, 2.5], "b": false}}',
            messages.SetAll(values={"a": [1, 2.5], "b": False}),
        ),
        ('{"do": "set_all", "values": {"a": null}}', "set_all: a is None; a switch, a finite number, a text or a list"),
        ('{"do": "trigger"}', "trigger: service is missing; one of enable, disable, estop, reset is needed"),
        ('{"do": "guide", "act": "dance"}', "guide: act is 'dance'; one of play, pause, step, slow, fast is needed"),
        ('{"do": "dance"}', "a message asks for none of seen, aim, trigger, set_all, scene, method"),
    ],
)
def test_what_is_within_the_limits_is_taken_as_it_stands_and_a_refusal_names_the_value_and_what_is_needed(text, meant):
    if isinstance(meant, messages.Message):
        assert messages.parse(text) == meant
        return
    with pytest.raises(ValueError, match=re.escape(meant)):
        messages.parse(text)


def test_all_live_values_with_as_many_walls_as_there_may_be_are_one_message():
    walls = {"wall.normals": 2, "wall.offsets": 1, "wall.stiffness": 1, "wall.damping": 1}
    values = settings.live_of({one.name: one.default for one in settings.LIVE.values()})
    values |= {name: [-1e3 / 3.0] * (MOST_WALLS * count) for name, count in walls.items()}
    asked = json.dumps({"do": "set_all", "values": values})

    async def visit(server, http):
        async with opened(http, server) as socket:
            await socket.send_str(asked)
            return await hear(socket, "answer")

    answer, done = served(visit)
    assert answer["done"] and len(done[0].values["wall.normals"]) == 2 * MOST_WALLS


@pytest.fixture
def no_time_passes(monkeypatch):
    """For the server's end of a page: it then takes no message beyond the burst, and gives up no silent page."""
    monkeypatch.setattr(session, "time", types.SimpleNamespace(monotonic=lambda: 100.0))


def test_the_server_outlives_rubbish_floods_and_messages_too_long_and_hears_a_stop_in_them(no_time_passes):
    aim = '{"do": "aim", "x": 0.1, "estop": "estop"}'  # it only holds the word, and is counted like any other

    async def visit(server, http):
        async with opened(http, server) as socket:
            for text in BAD:
                await socket.send_str(text)
            await socket.send_bytes(b"\0" * 100)
            hint = await hear(socket, "hint")
            for _ in range(3 * session.BURST):
                await socket.send_str(aim)
            await socket.send_str(STOP.model_dump_json())
            stopped = await hear(socket, "answer")
            await socket.send_str("x" * (2 * messages.LONGEST))
        async with opened(http, server) as socket:
            await socket.send_str(MARK)
            return hint, stopped, await hear(socket, "answer")

    (hint, stopped, answer), done = served(visit)
    assert hint and answer["to"]["text"] == "still there" and stopped["to"] == STOP.model_dump()
    assert 0 < done.count(messages.Aim(x=0.1)) <= session.BURST - len(BAD)
    assert done.count(STOP) == 1, "a stop is heard in a flood"


async def turned_away(reader):
    """Waits until the server closes the connection."""
    with contextlib.suppress(ConnectionError):
        while await asyncio.wait_for(reader.read(1000), LIMIT / 4):
            pass


ASKED = "GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def test_a_connection_that_asks_for_nothing_is_closed_and_an_open_page_stays(monkeypatch):
    monkeypatch.setattr(server_module, "HANDSHAKE", 1.0)

    async def visit(server, http):
        async with opened(http, server) as page:
            await hear(page, "hello")
            path = "/" + server.address(True).split("/", 3)[3]
            unfinished = ("", "GET / HT", ASKED, ASKED + "\r\n", ASKED + "\r\nGET")
            idle = [await knocked(server, said.format(path=path).encode()) for said in unfinished]
            await asyncio.gather(*(turned_away(reader) for reader, _ in idle))
            await page.send_str(MARK)
            return await hear(page, "answer")

    assert served(visit)[0]["done"]


def test_who_goes_away_or_sends_rubbish_is_worth_no_line_and_an_error_of_the_server_one_sentence(caplog):
    async def save():
        raise KeyError("no such\nnode")

    async def visit(server, http):
        address = server.address(True)
        head = ASKED.format(path="/" + address.split("/", 3)[3] + "{}")
        upgrade = f"Origin: {address.rsplit('/', 2)[0]}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        upgrade += f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'A' * 22}==\r\n\r\n"
        host = f"Host: {address.split('/')[2]}"
        asked = (head.format("socket").replace("Host: 127.0.0.1", host) + upgrade, head.format("main.js") + "\r\n")
        for said in (*asked * 20, *[head.format("")] * 60):
            _, writer = await knocked(server, said.encode())
            await writer.drain()
            writer.transport.abort()
            await asyncio.sleep(0.0)
        for said in (f"GET /{'a' * 200_000} HTTP/1.1\r\n", "x" * 200_000, head.format("") + f"A: {'a' * 200_000}"):
            await turned_away((await knocked(server, said.encode()))[0])
        async with http.get(f"{address}operating_point.yaml") as broken:
            return broken.status

    assert served(visit, save=save)[0] == 500
    assert caplog.messages == [r"haptic_viewer: a request failed: KeyError: 'no such\nnode'"]
    assert not any(record.exc_info for record in caplog.records)


def test_an_address_has_so_many_connections_at_most_and_one_that_goes_makes_room():
    async def visit(server, http):
        async with opened(http, server) as page:
            await hear(page, "hello")
            idle = [await knocked(server) for _ in range(server_module.MOST_CONNECTIONS - 1)]
            reader, _ = await knocked(server)
            await turned_away(reader)
            idle[0][1].close()
            await idle[0][1].wait_closed()
            await page.send_str(MARK)
            answer = await hear(page, "answer")
            async with http.get(server.address(True)) as again:
                return answer["done"], again.status

    assert served(visit)[0] == (True, 200)


class Full:
    """A page's socket with so much in its queue that it hands out one message after the other without a turn of the
    event loop; `given` counts them."""

    def __init__(self, texts):
        self._texts, self.given = iter(texts), 0

    def __aiter__(self):
        return self

    async def __anext__(self):
        for text in self._texts:
            self.given += 1
            return aiohttp.WSMessage(aiohttp.WSMsgType.TEXT, text, None)
        raise StopAsyncIteration

    async def send_str(self, text):
        pass


def test_an_e_stop_waits_neither_for_the_excess_before_it_nor_for_what_comes_behind(no_time_passes, monkeypatch):
    aim = '{"do": "aim", "x": 0.1}'
    socket, slept, begun, turns = Full([aim] * 5000 + [STOP.model_dump_json()] + [aim] * 5000), [], [], []
    turn = asyncio.sleep

    def sleep(seconds):
        slept.append(seconds)
        return turn(0.0)

    async def do(message, page):
        if message == STOP:
            begun.append(socket.given)

    async def others():
        while True:
            turns.append(socket.given)
            await turn(0.0)

    async def live():
        serving = asyncio.create_task(others())
        await session.Session(socket, True, do).serve()
        serving.cancel()

    monkeypatch.setattr(session.asyncio, "sleep", sleep)
    asyncio.run(live())
    assert sum(slept) == 0.0, "what is dropped holds up what comes behind it"
    assert len(begun) == 1 and 5000 < begun[0] <= 5001 + session.LAP
    others_served = zip([0, *turns], turns, strict=False)
    assert all(b - a <= session.LAP for a, b in others_served) and turns[-1] > 10_000 - session.LAP


@pytest.mark.parametrize("control", (True, False))
def test_a_flood_of_stops_has_few_under_way_and_one_more_when_those_are_done(no_time_passes, control):
    begun, answers = [], asyncio.Queue()

    async def do(message, page):
        begun.append(message)
        return await answers.get()

    async def live():
        flood = Full([STOP.model_dump_json()] * 5000)
        await session.Session(flood, control, do).serve()
        await asyncio.sleep(0.0)
        held = len(begun)
        for _ in range(10 * held):
            answers.put_nowait("stopped")
            await asyncio.sleep(0.0)
        return held

    assert asyncio.run(live()) == session.MOST_STOPS
    assert begun == [STOP] * (session.MOST_STOPS + 1)


def test_frames_are_dropped_for_a_page_that_does_not_keep_up_and_a_number_that_is_none_is_null(no_time_passes):
    async def visit(server, http):
        async with opened(http, server) as socket:
            await hear(socket, "hello")
            for number in range(30):
                server.show({"number": number})
                await asyncio.sleep(0.005)
            [page] = server.sessions
            waiting, dropped = page.sent - page.seen, page.dropped
            for _ in range(page.sent):
                last = json.loads((await socket.receive(LIMIT)).data)
            await socket.send_str(json.dumps({"do": "seen", "frame": last["number"]}))
            while page.seen < page.sent:
                await asyncio.sleep(0.005)
            server.show({"results": [math.nan, 1.0], "energy": (math.inf,)})
            server.tell("values", {"haptic_driver": {"a": -math.inf, "b": 2.0}})
            heard = [json.loads((await socket.receive(LIMIT)).data, parse_constant=pytest.fail) for _ in range(2)]
            return waiting, dropped, {news["kind"]: news["content"] for news in heard}

    (waiting, dropped, heard), _ = served(visit)
    assert waiting == session.UNSEEN and dropped == 30 - session.UNSEEN
    assert heard["frame"] == {"results": [None, 1.0], "energy": [None]}
    assert heard["values"] == {"haptic_driver": {"a": None, "b": 2.0}}


class Slow(Full):
    """A page's socket that says nothing and has been sent `said` once it takes anything."""

    def __init__(self):
        self.said = []

    async def __anext__(self):
        while not self.said or self.said[-1]["content"] != "the end":
            await asyncio.sleep(0.0)
        raise StopAsyncIteration

    async def send_str(self, text):
        self.said.append(json.loads(text))


def test_a_page_that_takes_nothing_is_kept_the_newest_answers_only():
    async def live():
        page = session.Session(socket := Slow(), True, None)
        for number in range(10 * session.MOST_ANSWERS):
            page.tell(f"{session.ANSWER}{number}", number)
            page.tell("status", number)
        page.tell("hint", "the end")
        await asyncio.wait_for(page.serve(), LIMIT)
        return socket.said

    said = asyncio.run(live())
    kept = [news["content"] for news in said if news["kind"].startswith(session.ANSWER)]
    assert kept == list(range(9 * session.MOST_ANSWERS, 10 * session.MOST_ANSWERS))
    assert len(said) == session.MOST_ANSWERS + 2


MACHINE = gethostname()


@pytest.mark.parametrize(
    ("listens", "answered", "not_answered"),
    [
        ("127.0.0.1", ("127.0.0.1:80", "[::1]:80", "LOCALHOST"), ("192.168.1.2:80", f"{MACHINE}:80", "0.0.0.0")),
        (
            "0.0.0.0",
            ("192.168.1.2:80", "localhost", f"{MACHINE.upper()}.local"),
            ("192.168.1.2.example", "a.example", ""),
        ),
        ("::", ("[fe80::1]:80",), ("elsewhere.example",)),
        ("lab.example", ("Lab.example",), ("elsewhere.example:80",)),
    ],
)
def test_a_server_answers_to_addresses_and_its_own_names_and_to_no_name_led_here(listens, answered, not_answered):
    guard, other, found = Guard(listens), Guard(listens), reachable(listens)
    tokens = {guard.control, guard.look, other.control, other.look}
    assert len(tokens) == 4 and min(map(len, tokens)) > 20, "they are new each time, and long"
    assert is_loopback(listens) == (listens == "127.0.0.1")
    assert (found == listens) == (listens not in ("0.0.0.0", "::")), "what is printed can be opened"
    for named in (*answered, f"[{found}]:80" if ":" in found else f"{found}:80"):
        guard.check_host(named)
    for named in not_answered:
        with pytest.raises(PermissionError, match="does not answer"):
            guard.check_host(named)


@pytest.mark.parametrize("host", ["a b", "192.0.2.1", "127.0.0.1"])  # no name, another machine's, a taken port
def test_an_address_that_cannot_be_served_is_refused_by_its_name(host):
    with create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ValueError) as refusal:
            asyncio.run(Server(host, port, None, None).start())
    assert re.fullmatch(rf"no page can be served on host '{host}', port {port}: [A-Z][\w ,]+", str(refusal.value))
