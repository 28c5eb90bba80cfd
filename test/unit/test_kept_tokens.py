# SPDX-License-Identifier: Apache-2.0
"""Links that stay: the same tokens at each start, in a file of this user alone, and fresh ones where that cannot be."""

import asyncio
import socket
import stat

import pytest
from hypothesis import given
from hypothesis import strategies as st
from in_process import haptic

from haptic_display.page import kept_tokens
from haptic_display.page import server as server_module
from haptic_display.page.server import PORTS, Server


@pytest.fixture
def home(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "haptic_display"


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def started(port, host="127.0.0.1"):
    """Tokens, port and notes of a server that has started, and has stopped again."""

    async def live():
        server = Server(host, port, None, None)
        await server.start()
        found = (server.guard.control, server.guard.look), int(server.address(True).split(":")[2].split("/")[0])
        await server.stop()
        return *found, server.notes

    return asyncio.run(live())


def free():
    """A port that was free a moment ago."""
    with socket.create_server(("127.0.0.1", 0)) as found:
        return found.getsockname()[1]


def test_another_user_can_neither_list_nor_read_the_tokens(home):
    home.mkdir(parents=True, mode=0o755)
    (control, look), note = kept_tokens.kept()
    assert (note, mode(home), mode(home / "links")) == ("", 0o700, 0o600) and control != look


def test_a_file_of_this_user_alone_is_taken_and_one_that_others_may_use_is_replaced_and_that_is_said(home):
    for rights in (0o600, 0o400, 0o640, 0o620, 0o604, 0o602, 0o610):
        before, _ = kept_tokens.kept()
        (home / "links").chmod(rights)
        after, note = kept_tokens.kept()
        if rights & 0o077:
            assert not set(after) & set(before) and mode(home / "links") == 0o600
            assert note == f"{home / 'links'} could be read or written by others: the links are new"
        else:
            assert (after, note) == (before, "")


@given(st.binary(max_size=120))
def test_whatever_the_file_holds_two_tokens_come_out_and_only_whole_ones_are_taken(tmp_path_factory, content):
    folder = tmp_path_factory.mktemp("state")
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("XDG_STATE_HOME", str(folder))
        kept_tokens.kept()
        (folder / "haptic_display" / "links").write_bytes(content)
        tokens, note = kept_tokens.kept()
    assert all(len(token) == 22 for token in tokens) and "holds no links" in note


def test_a_page_has_the_same_links_at_its_next_start_but_on_any_free_port_or_open_to_others_fresh_ones(home):
    port = free()
    mine = started(port)
    others = [*started(0)[0], *started(port, "0.0.0.0")[0]]
    assert mine == started(port) and not set(mine[0]) & set(others)


def test_the_default_port_goes_on_to_the_next_that_is_free_with_links_for_this_time_and_another_is_refused(
    home, monkeypatch
):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ValueError, match=f"port {port}: Address already in use"):
            started(port)
        monkeypatch.setattr(server_module, "HOME_PORT", port)
        tokens, found, _ = started(port)
        assert port < found < port + PORTS
    assert not set(tokens) & set(started(port)[0])


def test_view_with_new_link_makes_the_old_links_open_nothing(home, monkeypatch):
    before, _ = kept_tokens.kept()
    monkeypatch.setattr("haptic_display.page.viewer.main", lambda args, stop: 0)
    for words, same in (((), True), (("--new-link",), False)):
        assert haptic("view", *words).returncode == 0
        assert bool(set(kept_tokens.kept()[0]) & set(before)) == same
