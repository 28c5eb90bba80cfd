# SPDX-License-Identifier: Apache-2.0
"""People before the page of a report: what they see first, in light and dark. It needs no node."""

import pytest
from bag_of_a_run import swing, write_run
from conftest import Tab

from haptic_device.analysis.report.page import write_report
from haptic_device.analysis.report.reading import read_run


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The page of one run, and of two."""
    folder, rows = tmp_path_factory.mktemp("reports"), swing(4000)
    rows["tool_contact"][1000:3000] = 1
    runs = [read_run(write_run(folder / name, rows)) for name in ("soft", "hard")]
    return [write_report(runs[:count], folder / f"page_{count}") for count in (1, 2)]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("number", [0, 1])
def test_axe_finds_nothing_on_a_report_with_its_tables_open(chromium, pages, number, scheme):
    tab = Tab(chromium, color_scheme=scheme)
    tab.page.goto(pages[number].as_uri())
    tab.page.evaluate("document.querySelectorAll('details').forEach((table) => { table.open = true; })")
    found = tab.harm()
    dark = tab.page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    tab.page.close()
    assert found == []
    assert dark == (scheme == "dark")


def test_the_first_screen_has_date_verdict_contents_and_the_first_figure(chromium, pages):
    tab = Tab(chromium)
    tab.page.goto(pages[0].as_uri())
    for thing in (".verdict", "nav", "figure img"):
        box = tab.page.locator(thing).first.bounding_box()
        assert box["y"] + box["height"] <= 720, thing
    assert "2026" in tab.page.inner_text(".verdict") and "No fault." in tab.page.inner_text(".verdict")
    links = [link.bounding_box() for link in tab.page.locator("nav a").all()]
    assert min(min(box["width"], box["height"]) for box in links) >= 44
    tab.page.click("nav a[href='#energies']")
    assert tab.page.locator("#energies").bounding_box()["y"] < 720
    assert tab.complaints == []
    tab.page.close()
