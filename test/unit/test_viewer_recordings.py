# SPDX-License-Identifier: Apache-2.0
"""Recordings on the page, without nodes: the recorder's states, the bags that are listed, the files that are given."""

import asyncio
import itertools
import os
import sys
import time

import psutil
import pytest
from bag_of_a_run import swing, write_run
from filmed_bag import film_bag, rows_of
from test_viewer import served
from yarl import URL

from haptic_device.status import Status
from haptic_sim.viewer.bag_pages import BagPages
from haptic_sim.viewer.recordings import Recordings

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
        try:
            return await visit(server, http)
        finally:
            await recordings.pages.stop()

    return served(scanned, recorded=recordings.page)[0]


async def got(http, address):
    async with http.get(URL(address, encoded=True)) as answer:
        return answer.status, dict(answer.headers), await answer.text()


async def made(http, address):
    """The first answer that is no page which says that it is being made."""
    while True:
        status, headers, text = await got(http, address)
        if "Making the" not in text:
            return status, headers, text
        assert 'http-equiv="refresh"' in text
        await asyncio.sleep(0.2)


def test_only_bags_of_the_folder_and_files_that_were_made_are_given(news, tmp_path):
    write_run(tmp_path / "haptic_bags" / "one", swing(80))
    write_run(tmp_path / "outside", swing(80))
    (tmp_path / "haptic_reports").mkdir()
    (tmp_path / "haptic_reports" / "secret.html").write_text("secret")
    bags = ("bag=../outside", "bag=..%2Foutside", f"bag={tmp_path}/outside", "bag=.", "", "bag=one%00", "bag=one&" * 3)
    asked = [f"recordings/report.html?{words}" for words in bags]
    asked += [f"recordings/{file}?bag=one" for file in ("secret.html", "..%2F..%2Fsecret.html", "..%2freport.html", "")]

    async def visit(server, http):
        return [await got(http, f"{server.address(True)}{path}") for path in asked]

    answers = visited(news, visit)
    assert {path: status for path, (status, _, _) in zip(asked, answers, strict=True)} == dict.fromkeys(asked, 404)
    assert all("secret" not in text or "nothing called" in text for _, _, text in answers)
    assert not list((tmp_path / "haptic_reports").glob("*/*"))


def test_what_cannot_be_made_is_said_in_a_sentence_and_tried_again(news, tmp_path):
    bag = tmp_path / "haptic_bags" / "broken"
    bag.mkdir()
    (bag / "broken_0.mcap").write_bytes(b"no bag")

    async def visit(server, http):
        address = f"{server.address(True)}recordings/film.html?bag=broken"
        return await made(http, address), await got(http, address)

    (status, _, text), again = visited(news, visit)
    assert status == 503 and text.startswith("the film could not be made: ") and len(text.splitlines()) == 1
    assert again[0] == 200 and "Making the film" in again[2]


def of_pages(folder, run):
    """What run(pages) returns, with pages that are made in a folder."""

    async def live():
        pages = BagPages(folder / "pages")
        try:
            return await run(pages)
        finally:
            await pages.stop()

    return asyncio.run(live())


def test_a_page_whose_place_is_taken_or_whose_program_is_missing_is_refused_and_the_process_ends_with_the_viewer(
    tmp_path, monkeypatch
):
    bag = film_bag(tmp_path / "one", rows_of(1000))
    (tmp_path / "pages" / "one" / "report.html").mkdir(parents=True)

    async def run(pages):
        with pytest.raises(ValueError, match=r"the report could not be made: .*report\.html"):
            await pages.page("report.html", [bag], "one")
        (tmp_path / "pages" / "one" / "report.html").rmdir()
        with monkeypatch.context() as without:
            without.setattr(sys, "executable", str(tmp_path / "gone"))
            with pytest.raises(ValueError, match="the report could not be made: .*gone"):
                await pages.page("report.html", [bag], "one")
        assert "Making the report" in await pages.page("report.html", [bag], "one"), "it is tried again"
        [process] = psutil.Process().children()
        return process

    assert not of_pages(tmp_path, run).is_running()


def test_each_choice_of_recordings_has_a_page_of_its_own_whose_scripts_reach_no_page_of_the_viewer(
    news, tmp_path, monkeypatch
):
    asked, page = [], tmp_path / "film.html"
    page.write_text("made")

    async def noted(file, bags, name):
        asked.append(tmp_path / name)
        return page

    monkeypatch.setattr(news.pages, "page", noted)
    for name in ("a", "b", "a+b"):
        write_run(tmp_path / "haptic_bags" / name, swing(80))

    async def visit(server, http):  # a page that looks on only
        bags = ("bag=a&bag=b", "bag=a%2Bb", "bag=a", "bag=b&bag=a")
        return [await got(http, f"{server.address(False)}recordings/film.html?{words}") for words in bags]

    for status, headers, text in visited(news, visit):
        assert (status, text) == (200, "made")
        assert headers["Content-Security-Policy"].startswith("sandbox allow-scripts; default-src 'none'")
    assert len(set(asked)) == 4


def test_four_pages_are_waited_for_and_a_fifth_is_refused(tmp_path):
    bags = [film_bag(tmp_path / f"bag{number}", rows_of(1000)) for number in range(5)]

    async def run(pages):
        for bag in bags[:4]:
            assert "Making the" in await pages.page("film.html", [bag], bag.name)
        with pytest.raises(ValueError, match="4 reports wait to be made already"):
            await pages.page("film.html", bags[4:], "bag4")
        assert "Making the" in await pages.page("film.gif", bags[:1], "bag0"), "it is the same making"

    of_pages(tmp_path, run)
