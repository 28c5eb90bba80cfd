# SPDX-License-Identifier: Apache-2.0
"""Recordings on the page, without nodes: the recorder's states, the bags that are listed, the films that are given."""

import asyncio
import itertools
import os
import time

import psutil
import pytest
from bag_of_a_run import swing, write_run
from filmed_bag import film_bag, rows_of
from test_viewer import served
from yarl import URL

from haptic_device.recording.status import Status
from haptic_display.page.recordings import Recordings

pytestmark = pytest.mark.timeout(300)


@pytest.fixture
def news(tmp_path, monkeypatch):
    """Recordings of an empty folder; `told` is what they said, each time that it was something else."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "haptic_bags").mkdir()
    told = []
    recordings = Recordings(lambda: told.append(recordings.news()))
    recordings.told = told
    return recordings


def said(message, later=1):
    """A status of the recorder, so many seconds after now."""
    return Status(time.time_ns() + later * 10**9, 0, message, {})


async def answer(sentence):
    await asyncio.sleep(0)
    if isinstance(sentence, Exception):
        raise sentence
    return sentence


def states(recordings):
    return [one["state"] for one in recordings.told]


def test_a_recording_that_the_page_asks_for_is_starting_recording_saving_saved(news, tmp_path):
    async def run():
        news.hear(said("not recording"))
        await news.during(True, answer("recording"))
        news.hear(said("not recording", -5))
        news.hear(said(f"recording to {tmp_path}/haptic_bags/one"))
        write_run(tmp_path / "haptic_bags" / "one", swing(80))
        await news.during(False, answer("the bag is closed"))
        news.hear(said(f"recording to {tmp_path}/haptic_bags/one", -5))
        await news.during(True, answer("recording"))
        write_run(tmp_path / "haptic_bags" / "short", swing(80))  # shorter than the recorder's silence
        await news.during(False, answer("the bag is closed"))

    asyncio.run(run())
    turns = ["ready", "starting", "recording", "saving", "saved", *["starting", "recording", "saving", "saved"]]
    assert [state for state, _ in itertools.groupby(states(news))] == turns
    saved = [(one["name"], one["bag"]) for one in news.told if one["state"] == "saved" and one["name"]]
    assert list(dict.fromkeys(saved)) == [(name, str(tmp_path / "haptic_bags" / name)) for name in ("one", "short")]


def test_a_refusal_leaves_the_state_as_it_was(news):
    async def run():
        news.hear(said("not recording"))
        with pytest.raises(ValueError, match="disk"):
            await news.during(True, answer(ValueError("the disk is full")))

    asyncio.run(run())
    assert states(news) == ["ready", "starting", "ready"]


def test_a_recorder_that_somebody_else_switches_is_followed(news, tmp_path):
    for message in (None, "not recording", f"recording to {tmp_path}/else/one/bag", "not recording", None):
        news.hear(message and said(message))
    assert states(news) == ["no recorder", "ready", "recording", "saved", "no recorder"]
    assert news.folder == tmp_path / "else"


def test_bags_of_the_folder_are_listed_the_newest_first_without_those_that_cannot_be_read(news, tmp_path):
    folder = tmp_path / "haptic_bags"
    write_run(folder / "old", swing(400))
    whole = write_run(folder / "new" / "bag", swing(80))
    for name in ("cut", "unreadable"):
        (write_run(folder / name, swing(80)) / "metadata.yaml").unlink()
    (folder / "unreadable" / "metadata.yaml").mkdir()
    (folder / "dangling").mkdir()
    (folder / "dangling" / "far_0.mcap").symlink_to(folder / "nowhere.mcap")
    (folder / "no bag").mkdir()
    (folder / "link").symlink_to(folder / "old")
    for age, name in enumerate(("new/bag", "cut", "old")):
        os.utime(folder / name, (1e9 - age, 1e9 - age))
    asyncio.run(news.scan())
    bags = news.news()["bags"]
    assert [bag["name"] for bag in bags] == ["new", "cut", "old"]
    assert bags[1]["seconds"] is None and bags[2]["seconds"] == pytest.approx(0.1, abs=0.01) and bags[0]["size"] > 0
    (folder / "dangling" / "far_0.mcap").unlink()
    (folder / "dangling" / "far_0.mcap").symlink_to(next(whole.glob("*.mcap")))
    asyncio.run(news.scan())
    assert [bag["name"] for bag in news.news()["bags"]] == ["dangling", "new", "cut", "old"]


def visited(recordings, visit):
    async def scanned(server, http):
        await recordings.scan()
        return await visit(server, http)

    return served(scanned, film=recordings.film)[0]


async def got(http, address):
    async with http.get(URL(address, encoded=True)) as answer:
        return answer.status, dict(answer.headers), await answer.text()


def test_only_bags_of_the_folder_are_played(news, tmp_path):
    write_run(tmp_path / "haptic_bags" / "one", swing(80))
    write_run(tmp_path / "outside", swing(80))
    asked = [f"bag={name}" for name in ("../outside", "..%2Foutside", f"{tmp_path}/outside", ".", "", "one%00")]

    async def visit(server, http):
        return [await got(http, f"{server.address(True)}film.html?{words}") for words in [*asked, ""]]

    answers = visited(news, visit)
    assert [status for status, _, _ in answers] == [404] * 7
    assert all(text.startswith("there is no recording ") for _, _, text in answers)


def test_a_recording_is_played_by_who_looks_on_too_in_a_page_whose_scripts_reach_no_page_of_the_viewer(news, tmp_path):
    film_bag(tmp_path / "haptic_bags" / "a&b", rows_of(1000), marks=[(400, "here")])

    async def visit(server, http):
        return await got(http, f"{server.address(False)}film.html?bag=a%26b")

    status, headers, text = visited(news, visit)
    assert status == 200 and '"here"' in text and text.startswith("<!doctype html>")
    assert headers["Content-Security-Policy"].startswith("sandbox allow-scripts; default-src 'none'")


def test_what_cannot_be_played_is_said_in_a_sentence(news, tmp_path):
    bag = tmp_path / "haptic_bags" / "broken"
    bag.mkdir()
    (bag / "broken_0.mcap").write_bytes(b"no bag")

    async def visit(server, http):
        return await got(http, f"{server.address(True)}film.html?bag=broken")

    status, _, text = visited(news, visit)
    assert status == 503 and text.startswith("the film could not be made: ") and len(text.splitlines()) == 1
    assert "it is no MCAP file" in text


def test_films_are_made_one_at_a_time_and_end_with_the_server(news, tmp_path):
    for name in ("one", "two"):
        film_bag(tmp_path / "haptic_bags" / name, rows_of(1000))
    found = []

    async def visit(server, http):
        page = f"{server.address(True)}film.html?bag="
        asked = [asyncio.create_task(got(http, f"{page}{name}")) for name in ("one", "two")]
        while not (children := psutil.Process().children()):
            await asyncio.sleep(0.01)
        found.extend(children)
        for one in asked:
            one.cancel()

    visited(news, visit)
    assert len(found) == 1 and not found[0].is_running()
