# SPDX-License-Identifier: Apache-2.0
"""The viewer without nodes and without a browser: who may come in, what may be asked for, where the hand may go."""

import asyncio
import contextlib
import json
import math
import re
import types
from dataclasses import asdict
from socket import create_server, gethostname

import aiohttp
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from yarl import URL

from haptic_device.controller_config import MOST_WALLS
from haptic_device.yaml_reader import load as load_yaml
from haptic_sim.config_problems import problems
from haptic_sim.node.scene_publisher import CONTACT, state_names
from haptic_sim.node_parameters import NODES
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import Scene, load
from haptic_sim.viewer import messages, session, settings
from haptic_sim.viewer import server as server_module
from haptic_sim.viewer.guard import HEADERS, Guard, is_loopback, reachable
from haptic_sim.viewer.hand import AFTER, SILENCE, Hand, Limits
from haptic_sim.viewer.server import WEB, Server

pytestmark = pytest.mark.timeout(300)

LIMIT = 60.0  # [s] that anything is waited for
LIMITS = Limits(((-0.1, 0.1), (-0.2, 0.2), (-3.0, 3.0)), speed=1.0, turn=10.0)
FLAT = Limits(LIMITS.workspace[:2], 1.0, 10.0)
FOREIGN = {"Host": "elsewhere.example"}


async def saved():
    return "# saved\n"


async def loaded(file):
    raise ValueError(f"{len(file)} bytes are no parameter file")


def served(visit, do=None, host="127.0.0.1", save=saved, load=loaded):
    """What visit(server, http) returns, with a server on this machine that answers `do`."""
    done = []

    async def note(message, page):
        done.append(message)
        return "done"

    async def live():
        server = Server(host, 0, lambda page: page.tell("hello", page.control), do or note, save, load)
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


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("{address}", {}, 200),
        ("{address}main.js", {}, 200),
        ("{address}operating_point.yaml", {}, 200),
        ("{address}viewer.py", {}, 404),
        ("{address}" + 8000 * "a" + ".js", {}, 404),
        ("{address}" + 9000 * "a", {}, 400),
        ("{address}..%2Fviewer.py", {}, 404),
        ("{address}%2E%2E%2Fviewer.py", {}, 404),
        ("{address}..%5Cviewer.py", {}, 404),
        ("{address}%2Fetc%2Fpasswd", {}, 404),
        ("{address}/etc/passwd", {}, 404),
        ("{address}%2E", {}, 404),
        ("{address}web/", {}, 404),
        ("{address}unknown.js", {}, 404),
        ("{address}socket", {"Origin": "http://elsewhere.example"}, 403),
        ("{address}socket", {}, 403),
        ("{address}", FOREIGN, 403),
        ("{root}", {}, 403),
        ("{root}wrong/", {}, 403),
        ("{root}%C3%A9/socket", {}, 403),
    ],
)
def test_the_server_answers_its_own_page_only(path, headers, status):
    async def visit(server, http):
        address = server.address(True)
        url = URL(path.format(address=address, root=address.rsplit("/", 2)[0] + "/"), encoded=True)
        async with http.get(url, headers=headers) as answer:
            assert "Traceback" not in await answer.text()
            assert answer.status == 400 or HEADERS.items() <= answer.headers.items()
            return answer.status

    assert served(visit)[0] == status


@pytest.mark.parametrize("path", ("../viewer.py", "../../../setup.py", "./", "../web/main.js", "//etc/passwd"))
def test_no_way_that_a_browser_would_have_straightened_leads_out_of_the_pages_folder(path):
    async def visit(server, http):
        place = "/" + server.address(True).split("/", 3)[3] + path
        reader, _ = await knocked(server, f"GET {place} HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n".encode())
        return (await asyncio.wait_for(reader.read(), LIMIT)).decode()

    assert served(visit)[0].split()[1] in ("403", "404")


def test_what_is_not_fetched_but_posted_is_refused_with_the_same_headers():
    async def visit(server, http):
        async with http.post(server.address(True) + "main.js") as answer:
            return answer.status, HEADERS.items() <= answer.headers.items()

    assert served(visit)[0] == (405, True)


@pytest.mark.parametrize("kind", ("html", "js", "css", "svg"))
def test_each_file_of_the_page_comes_whole_as_what_it_is(kind):
    types = {"html": "text/html", "js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}
    files = list(WEB.glob(f"*.{kind}"))

    async def visit(server, http):
        found = []
        for file in files:
            async with http.get(server.address(False) + file.name) as answer:
                found.append((answer.content_type, await answer.read()))
        return found

    assert served(visit)[0] == [(types[kind], file.read_bytes()) for file in files] != []


ENABLE, STOP = messages.Trigger(service="enable"), messages.Trigger(service="estop")


def test_a_page_with_control_is_obeyed_and_one_that_is_view_only_is_not():
    async def visit(server, http):
        said = []
        for control in (True, False):
            async with opened(http, server, control) as socket:
                said.append(await hear(socket, "hello"))
                await socket.send_str(ENABLE.model_dump_json())
                said.append(await hear(socket, "answer" if control else "hint"))
        return said

    (control, answer, looking, hint), done = served(visit)
    assert (control, looking) == (True, False) and answer["done"]
    assert hint == "this page is view-only" and done == [ENABLE]


def test_an_e_stop_is_refused_to_no_page_and_nothing_else_is_allowed_to_one_that_is_view_only():
    others = [message.model_dump_json() for message in (ENABLE, messages.LetGo(), messages.TakeOver())]
    others += ['{"do": "aim", "x": 0.1}', '{"do": "trigger", "service": "disable"}', '{"do": "mark", "text": "estop"}']

    async def visit(server, http):
        async with opened(http, server, False) as socket:
            for text in others:
                await socket.send_str(text)
            await socket.send_str(STOP.model_dump_json())
            return await hear(socket, "answer")

    answer, done = served(visit)
    assert answer["done"] and done == [STOP]


BAD = (
    '{"do": "aim", "x": NaN}',
    '{"do": "aim", "x": Infinity}',
    '{"do": "aim", "x": 1e999}',
    '{"do": "aim"}',
    "{",
    '{"do": "aim", "x": "1"}',
    '{"do": "aim", "x": true}',
    "[]",
    "null",
    "[" * 3000,
    '{"do": ["aim"]}',
    '{"do": "trigger"}',
    '{"do": "set_all", "values": {}}',
    '{"do": "record", "on": 1}',
    '{"do": "aim", "x": ' + "9" * 400 + "}",
    '{"do": "set_all", "values": {"a": 1e300}}',
    '{"do": "_prepare"}',
    '{"do": "mark", "text": "' + "a" * 300 + '"}',
)


@pytest.mark.parametrize("text", BAD)
def test_a_malformed_message_is_refused_in_one_sentence(text):
    with pytest.raises(ValueError) as refusal:
        messages.parse(text)
    assert "\n" not in str(refusal.value) and len(str(refusal.value)) < 400


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ('{"do": "aim", "x": 9007199254740992}', "aim: x is 9007199254740992; a finite number below 2^53 is needed"),
        ('{"do": "aim", "z": 1.0}', "aim names none of x, y, theta"),
        ('{"do": "record", "on": 1}', "record: on is 1; true or false is needed"),
        ('{"do": "mark", "text": "' + 201 * "a" + '"}', "mark: text has 201 characters; the limit is 200"),
        (
            '{"do": "set_all", "values": {"a": null}}',
            "set_all: a is None; a switch, a finite number, a text or a list",
        ),
        ('{"do": "trigger"}', "trigger: service is missing; one of enable, disable, estop, reset is needed"),
        ('{"do": "trigger", "service": "start"}', "trigger: service is 'start'; one of enable, disable, estop, reset"),
        ('{"do": "dance"}', "a message asks for none of seen, aim, trigger, set_all, scene, method"),
    ],
)
def test_a_refusal_names_the_value_and_what_is_needed(text, sentence):
    with pytest.raises(ValueError) as refusal:
        messages.parse(text)
    assert str(refusal.value).startswith(sentence)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"do": "aim", "x": 9007199254740991, "z": 1.0}', messages.Aim(x=9007199254740991.0)),
        ('{"do": "mark", "text": "' + 200 * "a" + '"}', messages.Mark(text=200 * "a")),
        (
            '{"do": "set_all", "values": {"a": [1, 2.5], "b": false}}',
            messages.SetAll(values={"a": [1, 2.5], "b": False}),
        ),
        ('{"do": "start_scene"}', messages.StartScene()),
    ],
)
def test_what_is_within_the_limits_is_taken_as_it_stands(text, message):
    assert messages.parse(text) == message


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


@hypothesis_settings(max_examples=30)
@given(st.text())
def test_no_text_at_all_does_more_than_refuse(text):
    with contextlib.suppress(ValueError):
        messages.parse(text)


@pytest.fixture
def no_time_passes(monkeypatch):
    """For the server's end of a page: it then takes no message beyond the burst, and gives up no silent page."""
    monkeypatch.setattr(session, "time", types.SimpleNamespace(monotonic=lambda: 100.0))


def test_the_server_outlives_rubbish_floods_and_messages_too_long(no_time_passes):
    aim, stop = {"do": "aim", "x": 0.1}, {"do": "trigger", "service": "estop"}

    async def visit(server, http):
        async with opened(http, server) as socket:
            for text in BAD:
                await socket.send_str(text)
            await socket.send_bytes(b"\0" * 100)
            hint = await hear(socket, "hint")
            for _ in range(3 * session.BURST):
                await socket.send_str(json.dumps(aim))
            await socket.send_str(json.dumps(stop))
            stopped = await hear(socket, "answer")
            await socket.send_str("x" * (2 * messages.LONGEST))
        async with opened(http, server) as socket:
            await socket.send_str('{"do": "mark", "text": "still there"}')
            return hint, stopped, await hear(socket, "answer")

    (hint, stopped, answer), done = served(visit)
    assert hint and answer["to"]["text"] == "still there"
    assert 0 < done.count(messages.Aim(x=0.1)) <= session.BURST - len(BAD)
    assert stopped["to"] == stop and done.count(messages.Trigger(service="estop")) == 1, "a stop is heard in a flood"


async def knocked(server, said=b""):
    """A connection that has said this; its (reader, writer)."""
    host, port = server.address(True).split("/")[2].split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(said)
    return reader, writer


async def turned_away(reader):
    """Waits until the server closes the connection."""
    with contextlib.suppress(ConnectionError):
        while await asyncio.wait_for(reader.read(1000), LIMIT / 4):
            pass


ASKED = "GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n"


@pytest.mark.parametrize("said", ("", "GET / HT", ASKED, ASKED + "\r\n", ASKED + "\r\nGET"))
def test_a_connection_that_asks_for_nothing_is_closed_and_an_open_page_stays(said, monkeypatch):
    monkeypatch.setattr(server_module, "HANDSHAKE", 1.0)

    async def visit(server, http):
        async with opened(http, server) as page:
            await hear(page, "hello")
            path = "/" + server.address(True).split("/", 3)[3]
            reader, _ = await knocked(server, said.format(path=path).encode())
            await turned_away(reader)
            await page.send_str('{"do": "mark", "text": "still there"}')
            return await hear(page, "answer")

    assert served(visit)[0]["done"]


def test_an_address_has_so_many_connections_at_most_and_one_that_goes_makes_room():
    async def visit(server, http):
        async with opened(http, server) as page:
            await hear(page, "hello")
            idle = [await knocked(server) for _ in range(server_module.MOST_CONNECTIONS - 1)]
            reader, _ = await knocked(server)
            await turned_away(reader)
            idle[0][1].close()
            await idle[0][1].wait_closed()
            await page.send_str('{"do": "mark", "text": "still there"}')
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
    aim, stop = '{"do": "aim", "x": 0.1}', '{"do": "trigger", "service": "estop"}'
    socket, slept, begun, turns = Full([aim] * 5000 + [stop] + [aim] * 5000), [], [], []
    turn = asyncio.sleep

    def sleep(seconds):
        slept.append(seconds)
        return turn(0.0)

    async def do(message, page):
        if isinstance(message, messages.Trigger):
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
    assert all(b - a <= session.LAP for a, b in zip([0, *turns], turns, strict=False)), (
        "other pages are served meanwhile"
    )
    assert turns[-1] > 10_000 - session.LAP


def test_a_message_that_only_holds_the_word_estop_is_counted_like_any_other(no_time_passes):
    aim = '{"do": "aim", "x": 0.1, "estop": "estop"}'

    async def visit(server, http):
        async with opened(http, server) as socket:
            for _ in range(2 * session.BURST):
                await socket.send_str(aim)
            await socket.send_str(STOP.model_dump_json())
            return await hear(socket, "answer")

    answer, done = served(visit)
    assert answer["done"] and 0 < done.count(messages.Aim(x=0.1)) <= session.BURST and done[-1] == STOP


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


def test_what_goes_wrong_is_the_answer():
    async def refuse(message, page):
        raise ValueError("the driver says no")

    async def visit(server, http):
        async with opened(http, server) as socket:
            await socket.send_str('{"do": "set_all", "values": {"coupling.stiffness": 9e9}}')
            return await hear(socket, "answer")

    answer = served(visit, refuse)[0]
    assert not answer["done"] and answer["sentence"] == "the driver says no"


def test_frames_are_dropped_for_a_page_that_does_not_keep_up(no_time_passes):
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
            server.show({"number": 30})
            return waiting, dropped, await hear(socket, "frame")

    (waiting, dropped, frame), _ = served(visit)
    assert waiting == session.UNSEEN and dropped == 30 - session.UNSEEN and frame == {"number": 30}


def test_a_number_that_is_none_is_null_in_frames_and_in_news():
    async def visit(server, http):
        async with opened(http, server) as socket:
            await hear(socket, "hello")
            server.show({"results": [math.nan, 1.0], "energy": (math.inf,)})
            server.tell("values", {"values": {"haptic_driver": {"a": -math.inf, "b": 2.0}}})
            heard = [json.loads((await socket.receive(LIMIT)).data, parse_constant=pytest.fail) for _ in range(2)]
            return {news["kind"]: news["content"] for news in heard}

    heard = served(visit)[0]
    assert heard["frame"] == {"results": [None, 1.0], "energy": [None]}
    assert heard["values"] == {"values": {"haptic_driver": {"a": None, "b": 2.0}}}


class Slow:
    """A page's socket that says nothing and has been sent `said` once it takes anything."""

    def __init__(self):
        self.said = []

    def __aiter__(self):
        return self

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


@pytest.mark.parametrize("host", ("127.0.0.1", "localhost", "::1", "0.0.0.0", "192.168.1.2", "example.org"))
def test_what_is_this_machine_alone(host):
    assert is_loopback(host) is (host in ("127.0.0.1", "localhost", "::1"))


MACHINE = gethostname()


@pytest.mark.parametrize(
    ("listens", "named", "answered"),
    [
        ("127.0.0.1", "127.0.0.1:80", True),
        ("127.0.0.1", "localhost:80", True),
        ("127.0.0.1", "[::1]:80", True),
        ("127.0.0.1", "LOCALHOST", True),
        ("127.0.0.1", "192.168.1.2:80", False),
        ("127.0.0.1", f"{MACHINE}:80", False),
        ("0.0.0.0", "192.168.1.2:80", True),
        ("0.0.0.0", "localhost:80", True),
        ("0.0.0.0", f"{MACHINE}:80", True),
        ("0.0.0.0", f"{MACHINE.upper()}.local", True),
        ("::", "[fe80::1]:80", True),
        ("lab.example", "Lab.example", True),
        ("0.0.0.0", "elsewhere.example:80", False),
        ("0.0.0.0", "", False),
        ("0.0.0.0", "192.168.1.2.example", False),
        ("192.168.1.2", "elsewhere.example", False),
        ("lab.example", "elsewhere.example:80", False),
    ],
)
def test_a_server_answers_to_addresses_and_its_own_names_and_to_no_name_led_here(listens, named, answered):
    guard = Guard(listens)
    if answered:
        guard.check_host(named)
    else:
        with pytest.raises(PermissionError, match="does not answer"):
            guard.check_host(named)


@pytest.mark.parametrize("host", ("0.0.0.0", "::"))
def test_a_server_on_every_address_prints_one_that_can_be_opened_and_that_it_answers_to(host):
    found = reachable(host)
    assert found not in ("0.0.0.0", "::", "")
    Guard(host).check_host(f"[{found}]:80" if ":" in found else f"{found}:80")


@pytest.mark.parametrize("host", ("127.0.0.1", "192.168.1.2", "lab.example", "::1"))
def test_any_other_host_is_printed_as_it_is(host):
    assert reachable(host) == host


def test_a_server_on_every_address_of_this_machine_is_found_at_the_address_that_it_prints():
    async def visit(server, http):
        async with http.get(address := server.address(True)) as answer, http.get(address, headers=FOREIGN) as no:
            return answer.status, no.status

    assert served(visit, host="0.0.0.0")[0] == (200, 403)


def test_tokens_are_new_each_time_and_long():
    one, other = Guard("127.0.0.1"), Guard("127.0.0.1")
    assert len({one.control, one.look, other.control, other.look}) == 4 and min(map(len, (one.control, one.look))) > 20


def test_the_hand_is_led_no_faster_than_its_speed_and_arrives():
    hand, now, places = Hand(), 0.0, []
    hand.take((0.0, 0.0, 0.0), now)
    assert hand.aim({"x": 0.06, "y": 0.08, "theta": 1.0}, LIMITS) == ""
    while (place := hand.lead(now := now + 0.01, LIMITS)) is not None:
        places.append(place)
    steps = [math.dist(a[:2], b[:2]) for a, b in zip(places, places[1:], strict=False)]
    assert max(steps) <= 0.01 * LIMITS.speed * (1.0 + 1e-9) and places[-1] == (0.06, 0.08, 1.0)
    assert max(b[2] - a[2] for a, b in zip(places, places[1:], strict=False)) <= 0.01 * LIMITS.turn * (1.0 + 1e-9)


def test_a_silence_does_not_let_the_hand_jump():
    hand = Hand()
    hand.take((0.0, 0.0, 0.0), 0.0)
    hand.aim({"x": 0.1}, LIMITS)
    x, *_ = hand.lead(100.0, LIMITS)
    assert x <= 0.1 * LIMITS.speed


def test_a_hand_held_still_by_a_live_page_holds_and_one_whose_page_is_silent_lets_go():
    hand, now = Hand(), 0.0
    hand.take((0.0, 0.0, 0.0), now)
    hand.aim({"x": 0.05}, LIMITS)
    for heard in range(1, 1000):
        hand.listen(now := now + 0.016, heard)
    silent = now
    while now < silent + SILENCE:
        assert hand.goal == (0.05, 0.0, 0.0) and not hand.loose
        hand.listen(now := now + 0.016, heard)
    hand.listen(now + 0.016, heard)
    assert hand.goal is None and hand.loose and hand.lead(now + 0.016, LIMITS) is None


def test_what_the_viewer_itself_sleeps_through_is_no_silence_of_a_page():
    hand = Hand()
    hand.take((0.0, 0.0, 0.0), 0.0)
    hand.listen(0.1, 1)
    hand.listen(100.0, 1)
    assert hand.goal is not None and not hand.loose


def test_a_hand_that_has_let_go_gives_in_to_the_handle_until_it_has_rested_there():
    hand, now, handle, target = Hand(), 0.0, 0.0, 0.05
    hand.loose, said = True, []
    while (place := hand.give_in(now := now + 0.016, (handle, 0.0, 0.0), (target, 0.0, 0.0), LIMITS)) is not None:
        assert place == (handle, 0.0, 0.0), "wherever the handle is, the hand pulls at nothing"
        said.append(now)
        target, handle = handle, max(-0.02, handle - 0.0005)
    assert handle == target == -0.02 and said[-1] > 40 * 0.016
    hand.take((0.0, 0.0, 0.0), now)
    assert not hand.loose


def test_a_hand_that_has_let_go_is_held_by_nobody_and_goes_with_the_handle_no_further_than_the_limits():
    hand, page = Hand(), object()
    hand.take((0.05, 0.0, 0.0), 0.0)
    hand.leader = page
    hand.let_go(1.0)
    assert hand.goal is None and hand.leader is None and hand.lead(1.0, LIMITS) is None
    for handle, target in ((0.099, 0.099), (0.101, 0.1)):
        place = hand.give_in(1.1, (handle, 0.0, 0.0), (0.05, 0.0, 0.0), LIMITS)
        assert place == (target, 0.0, 0.0)
    assert hand.give_in(1.1 + 2 * AFTER, (0.2, 0.0, 0.0), (0.1, 0.0, 0.0), LIMITS) is None, "at the limit it rests"


@hypothesis_settings(max_examples=30)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_wherever_it_is_dragged_the_hand_stays_in_the_workspace_and_says_so(x):
    hand = Hand()
    hand.take((0.0, 0.0, 0.0), 0.0)
    hint = hand.aim({"x": x}, LIMITS)
    assert -0.1 <= hand.goal[0] <= 0.1 and bool(hint) == (abs(x) > 0.1)


def test_a_drag_beyond_the_workspace_and_back_ends_where_it_began():
    hand = Hand()
    hand.take((0.05, 0.0, 0.0), 0.0)
    for x in (0.15, 0.3, 0.15, 0.05):
        hand.aim({"x": x}, LIMITS)
    assert hand.goal == (0.05, 0.0, 0.0)


def test_a_hand_that_is_slower_than_the_pointer_goes_on_to_its_last_place():
    hand, now = Hand(), 0.0
    hand.take((0.0, 0.0, 0.0), now)
    for x in (0.03, 0.06, 0.09):
        hand.aim({"x": x}, LIMITS)
        place = hand.lead(now := now + 0.01, LIMITS)
    assert place[0] == pytest.approx(0.03), "1 m/s for 30 ms"
    while (next_place := hand.lead(now := now + 0.01, LIMITS)) is not None:
        place = next_place
    assert place[0] == 0.09


def test_a_device_without_rotation_says_so_and_the_rest_is_done():
    hand = Hand()
    hand.take((0.0, 0.0, 0.0), 0.0)
    assert hand.aim({"x": 0.05, "theta": 1.0}, FLAT) == "the device has no theta axis"
    assert hand.goal == (0.05, 0.0, 0.0)


def test_every_live_parameter_of_the_driver_is_declared_to_the_page_as_json():
    told = json.loads(json.dumps(settings.declarations(), allow_nan=False))
    assert [one["name"] for one in told] == [one.name for one in NODES["haptic_driver"] if one.live]
    assert all(one["low"] is not None for one in told if one["kind"] in ("number", "whole"))


@pytest.mark.parametrize(
    ("name", "given", "taken"),
    [
        ("coupling.stiffness", 300, 300.0),
        ("wall.stiffness", [1, 2.5], [1.0, 2.5]),
        ("velocity.window", 4.0, 4),
        ("passivity.policy", "warn", "warn"),
        ("passivity.control", False, False),
    ],
)
def test_values_of_the_page_get_the_type_of_the_declaration(name, given, taken):
    assert settings.typed(name, given) == taken and type(settings.typed(name, given)) is type(taken)


NUMBER = "coupling.stiffness"
REFUSED = ("servo.rate", 1000.0), ("nonsense", 1), (NUMBER, "stiff"), (NUMBER, True), ("passivity.control", 1)


@pytest.mark.parametrize(("name", "given"), REFUSED)
def test_what_may_not_be_set_is_refused_before_anybody_is_asked(name, given):
    with pytest.raises(ValueError, match=name):
        settings.typed(name, given)


def test_a_file_that_would_lack_what_a_node_does_not_say_is_refused_in_a_sentence():
    async def silent():
        raise ValueError("haptic_driver does not answer")

    async def visit(server, http):
        async with http.get(f"{server.address(True)}operating_point.yaml") as answer:
            return answer.status, await answer.text()

    assert served(visit, save=silent)[0] == (503, "nothing is saved: haptic_driver does not answer\n")


def test_the_saved_file_names_what_differs_and_passes_the_check(tmp_path):
    values = {node: {one.name: one.default for one in declared} for node, declared in settings.NODES.items()}
    values["haptic_driver"] |= {"coupling.stiffness": 1500.0, "wall.normals": [0.0, 1.0], "wall.offsets": [-0.02]}
    values["haptic_driver"] |= {"wall.stiffness": [1000.0], "wall.damping": [0.1]}
    path = tmp_path / "saved.yaml"
    path.write_text(settings.operating_point("/haptic", values))
    assert list(problems(path)) == []
    [given] = load_yaml(path).values()
    assert given["ros__parameters"]["coupling.stiffness"] == 1500.0 and len(given["ros__parameters"]) == 5


@pytest.mark.parametrize("name", ("peg_in_hole", "wrench_on_nut", "four_bar", "slider", "wall", "stack_20"))
def test_a_scene_survives_its_way_over_the_topic_and_can_be_drawn(name):
    scene = load(name)
    again = Scene.model_validate_json(scene.model_dump_json(by_alias=True, exclude_unset=True))
    assert again == scene
    drawn = json.loads(json.dumps(asdict(drawing_of(again)), allow_nan=False))
    assert len(drawn["solids"]) == 1 + len(scene.bodies)
    left, bottom, right, top = drawn["room"]
    assert left < scene.tool.pose[0] < right and bottom < scene.tool.pose[1] < top
    assert len(state_names(scene)) == 3 * (2 + len(scene.bodies)) + 1 + len(scene.measure)


def test_contacts_are_points_of_nine_numbers():
    assert CONTACT.itemsize == 8 * len(CONTACT.names) == 72


def test_the_page_fetches_nothing_from_elsewhere():
    for file in WEB.iterdir():
        text = file.read_text(encoding="utf-8")
        assert "https://" not in text, file.name
        assert [word for word in text.split() if "http://" in word] in ([], ['xmlns="http://www.w3.org/2000/svg"'])


@pytest.mark.parametrize("host", ["a b", "192.0.2.1", "127.0.0.1"])  # no name, another machine's, a taken port
def test_an_address_that_cannot_be_served_is_refused_by_its_name(host):
    with create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ValueError) as refusal:
            asyncio.run(Server(host, port, None, None).start())
    assert re.fullmatch(rf"no page can be served on host '{host}', port {port}: [A-Z][\w ,]+", str(refusal.value))
