# SPDX-License-Identifier: Apache-2.0
"""The site of the documents as a reader's browser shows it: each page, its links and pictures, the search."""

import subprocess
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe

pytestmark = pytest.mark.timeout(600)  # a hundred pages
ROOT = Path(__file__).parents[2]
COLOURED = ("index.html", "theory/passivity.html", "reference/cli.html", "reference/api/theory.html")
EMPTY = {"config": {"fields": {}, "lang": ["en"], "separator": " ", "pipeline": []}, "docs": []}  # index of the search
COLOURS = ("color-contrast", "link-in-text-block")  # rules that take a second a page
SHOWN = """async () => {
    for (const image of document.images) image.loading = "eager";  // also what is folded or far below
    const loaded = (image) => image.decode().then(() => true, () => false);
    const whole = new Map(await Promise.all([...document.images].map(async (image) => [image, await loaded(image)])));
    return {
        links: [...document.querySelectorAll("a[href]")].map((link) => link.href),
        names: [...document.querySelectorAll("[id], a[name]")].map((part) => part.id || part.name),
        pictures: [...whole].filter(([image, is]) => !is || !image.alt).map(([image]) => image.src),
        wide: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    };
}"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The built site."""
    built = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(built)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return built


@pytest.fixture(scope="module")
def address(folder):
    """Where it is served."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


class Reader:
    """A tab on the site; `trouble` is what went wrong in it: errors, failed requests, requests to others."""

    def __init__(self, browser, address, **given):
        self.page, self._address, self.trouble = browser.new_page(**given), address, []
        self.page.on("console", lambda line: self._note(line.text) if line.type == "error" else None)
        self.page.on("pageerror", lambda error: self._note(str(error)))
        self.page.on("requestfailed", lambda request: self._note(f"{request.failure}: {request.url}"))
        self.page.on(
            "response", lambda answer: self._note(f"{answer.status}: {answer.url}") if answer.status >= 400 else None
        )
        self.page.on("request", lambda request: None if self._ours(request.url) else self._note(request.url))

    def _ours(self, url):
        return url.startswith((self._address, "data:", "blob:"))

    def _note(self, what):
        self.trouble.append((self.page.url.removeprefix(self._address), what))

    def open(self, name):
        self.page.goto(self._address + name, wait_until="load")

    def harm(self, left_out=()):
        """What axe finds serious or critical: rule and elements; left_out: rules."""
        options = {"resultTypes": ["violations"], "rules": {rule: {"enabled": False} for rule in left_out}}
        found = Axe().run(self.page, options=options).response["violations"]
        bad = [rule for rule in found if rule["impact"] in ("serious", "critical")]
        return [(rule["id"], [node["target"] for node in rule["nodes"]][:3]) for rule in bad]

    def found(self, words):
        """Addresses that the search finds, the best first."""
        self.page.keyboard.press("/")
        self.page.keyboard.type(words)
        links = self.page.locator(".md-search-result__link")
        links.first.wait_for()
        return [link.get_attribute("href").removeprefix(self._address) for link in links.all()]


def broken(address, shown):
    """(page, link) of each link within the site that leads to no page, file or heading of it."""
    names = {page: set(found["names"]) for page, found in shown.items()}
    for page, found in shown.items():
        for link in found["links"]:
            target, part = urldefrag(link)
            if not target.startswith(address):
                continue
            target = unquote(urlsplit(target).path).lstrip("/") or "index.html"
            if target not in names or (part and unquote(part) not in names[target]):
                yield page, link


def test_each_page_opens_whole_and_alone_and_everybody_can_read_it(chromium, folder, address):
    reader = Reader(chromium, address, viewport={"width": 390, "height": 844})
    reader.page.route("**/search_index.json", lambda route: route.fulfill(json=EMPTY))  # it is read anew on each page
    pages = sorted(str(file.relative_to(folder)) for file in folder.rglob("*.html"))
    shown, harm = {}, {}
    for page in pages:
        if page == "404.html":
            continue
        reader.open(page)
        shown[page], harm[page] = reader.page.evaluate(SHOWN), reader.harm(COLOURS)
    reader.page.close()
    files = {str(file.relative_to(folder)): {"names": [], "links": []} for file in folder.rglob("*") if file.is_file()}
    assert len(shown) > 60
    assert reader.trouble == []
    assert {page: found["pictures"] for page, found in shown.items() if found["pictures"]} == {}
    assert [page for page, found in shown.items() if found["wide"] > 0] == []  # what is wide scrolls in itself
    assert list(broken(address, {**files, **shown})) == []
    assert {page: found for page, found in harm.items() if found} == {}


@pytest.mark.parametrize(("width", "scheme"), [(390, "light"), (390, "dark"), (1400, "light"), (1400, "dark")])
def test_pages_are_legible_and_no_wider_than_the_screen(chromium, address, width, scheme):
    reader = Reader(chromium, address, color_scheme=scheme, viewport={"width": width, "height": 800})
    for page in COLOURED:
        reader.open(page)
        assert (
            reader.page.get_attribute("body", "data-md-color-scheme") == {"light": "default", "dark": "slate"}[scheme]
        )
        assert reader.harm() == [], page
        assert reader.page.evaluate(SHOWN)["wide"] <= 0, page
    reader.page.close()
    assert reader.trouble == []


def test_formulas_are_typeset_without_a_script(chromium, address):
    page = chromium.new_page(java_script_enabled=False)
    page.goto(address + "theory/passivity.html")
    formulas = page.locator("math")
    assert formulas.count() > 0
    assert formulas.first.bounding_box()["height"] > 0
    assert "\\frac" not in page.inner_text("article")
    page.close()


@pytest.mark.parametrize("way", ["served", "as files"])
def test_the_search_finds_the_page_on_passivity(chromium, folder, address, way):
    reader = Reader(chromium, address if way == "served" else folder.as_uri() + "/")
    reader.open("index.html")
    assert reader.found("passivity")[0].startswith("theory/passivity.html")
    reader.page.close()
    assert reader.trouble == []
