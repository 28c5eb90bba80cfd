# SPDX-License-Identifier: Apache-2.0
"""A report's page as a Chromium draws it, into docs/figures/report.png.

On the left its top, on the right its figures from the first on. Needs the extra `browser` and a Chromium (make
test-browser). A palette makes the picture a third as large.
"""

import io
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from browser.chromium import OPTIONS, find
from PIL import Image
from playwright.sync_api import sync_playwright

from haptic_device.analysis.report.page import write_report
from haptic_device.analysis.report.reading import read_run

ROOT = Path(__file__).parents[2]
SIZE = {"width": 760, "height": 1600}
COLOURS = 256


def photographs(page):
    """The top of a page, and what stands under its heading "Figures"."""
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find(), args=list(OPTIONS))
        tab = browser.new_page(viewport=SIZE)
        tab.goto(page.as_uri())
        shots = [tab.screenshot()]
        tab.get_by_role("heading", name="Figures").evaluate("heading => heading.scrollIntoView()")
        shots.append(tab.screenshot())
        browser.close()
    return [Image.open(io.BytesIO(shot)).convert("RGB") for shot in shots]


def main(bag: Annotated[Path, typer.Argument(help="Bag of a recorded run.")]) -> None:
    """A report's page as a Chromium draws it, into docs/figures/report.png."""
    path = ROOT / "docs" / "figures" / "report.png"
    with tempfile.TemporaryDirectory() as folder:
        top, figures = photographs(write_report([read_run(bag)], Path(folder)))
    both = Image.new("RGB", (top.width + figures.width, top.height))
    both.paste(top, (0, 0))
    both.paste(figures, (top.width, 0))
    both.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1024:.0f} KiB")
