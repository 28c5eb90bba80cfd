# SPDX-License-Identifier: Apache-2.0
"""People before the page of a report: what they see first, in light and dark. It needs no node."""

import pytest
from bag_of_a_run import swing, write_run
from conftest import Tab

from haptic_display.run.report.page import write_report
from haptic_display.run.report.reading import read_run

pytestmark = pytest.mark.timeout(600)


def test_the_first_screen_of_a_report_has_verdict_and_figure_and_axe_finds_nothing_in_it(chromium, tmp_path):
    rows = swing(4000)
    rows["tool_contact"][1000:3000] = 1
    runs = [read_run(write_run(tmp_path / name, rows)) for name in ("soft", "hard")]
    for count, scheme in ((1, "light"), (2, "dark")):
        tab = Tab(chromium, color_scheme=scheme)
        tab.page.goto(write_report(runs[:count], tmp_path / f"page_{count}").as_uri())
        if count == 1:
            for thing in (".verdict", "nav", "figure img"):
                box = tab.page.locator(thing).first.bounding_box()
                assert box["y"] + box["height"] <= 720, thing
            assert "2026" in tab.page.inner_text(".verdict") and "No fault." in tab.page.inner_text(".verdict")
        links = [link.bounding_box() for link in tab.page.locator("nav a").all()]
        assert min(min(box["width"], box["height"]) for box in links) >= 44
        tab.page.click("nav a[href='#energies']")
        assert tab.page.locator("#energies").bounding_box()["y"] < 720
        tab.page.evaluate("document.querySelectorAll('details').forEach((table) => { table.open = true; })")
        dark = tab.page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
        assert tab.harm() == tab.complaints == [] and dark == (scheme == "dark")
        tab.page.close()
