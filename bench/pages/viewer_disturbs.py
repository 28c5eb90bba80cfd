# SPDX-License-Identifier: Apache-2.0
"""Runs the demo in pairs, without and with a viewer whose page a Chromium draws, and prints what the servo notices.

For each figure median and range; how it differs with a page from that without, in the median over the pairs; and the
noise, which is how two runs alike differ (median over all twos of runs with a page, and of runs without).

Needs the extra `browser` and a Chromium: make test-browser.
"""

import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

import typer
from browser.chromium import OPTIONS, find
from playwright.sync_api import sync_playwright

from bench.recording.paired import compared
from haptic_sim.supervision.domain import isolated_domain

HAPTIC = [sys.executable, "-m", "haptic_sim.cli.main"]
FIGURES = {
    "ticks missed of 10000": lambda found: 1e4 * found["servo"]["missed"] / found["servo"]["ticks"],
    "lateness, 99 % [µs]": lambda found: found["servo"]["lateness_us"]["p99"],
    "age of the tool sample, median [ms]": lambda found: found["exchange"]["age_ms"]["p50"],
    "age of the tool sample, 99 % [ms]": lambda found: found["exchange"]["age_ms"]["p99"],
    "samples answered [%]": lambda found: 100.0 * found["exchange"]["answered"] / found["exchange"]["sent"],
}


def run(seconds, domain):
    """Figures of one demo."""
    with tempfile.TemporaryDirectory() as folder:
        words = [*HAPTIC, "demo", "--json", "--seconds", str(seconds), "--out", f"{folder}/run"]
        done = subprocess.run(words, env=environment(domain), capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def environment(domain):
    return {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@contextmanager
def page(browser, domain, drawn):
    """A viewer and a page that draws; appends the page's frames per second and the viewer's share of a core."""
    viewer = subprocess.Popen([*HAPTIC, "view"], env=environment(domain), stdout=subprocess.PIPE, text=True)
    address = re.search(r"http://\S+", viewer.stdout.readline()).group()
    tab = browser.new_page(viewport={"width": 1280, "height": 720})
    tab.goto(address)
    try:
        yield
        shown = tab.evaluate("({...document.documentElement.dataset})")
        drawn.append((int(shown["drawn"]), 100.0 * float(shown["cpu"])))
    finally:
        tab.close()
        viewer.send_signal(2)
        viewer.wait(20)


def row(name, found):
    """A figure without and with a page, what the page adds, and how much two runs alike differ."""
    columns = [[FIGURES[name](one) for one in found[viewed]] for viewed in (False, True)]
    shown = [f"{statistics.median(c):.2f} ({min(c):.2f} to {max(c):.2f})" for c in columns]
    added, noise, within = compared(*columns)
    return f"| {name} | {shown[0]} | {shown[1]} | {added:+.2f} | {noise:.2f} | {within} |"


def main(
    pairs: Annotated[int, typer.Argument(min=1)] = 6,
    seconds: Annotated[int, typer.Argument(min=1, help="Of each run.")] = 8,
) -> None:
    """What the servo notices of a viewer whose page a Chromium draws."""
    found, drawn = {False: [], True: []}, []
    with tempfile.TemporaryDirectory() as folder, isolated_domain(Path(folder)) as domain, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find(), args=list(OPTIONS))
        for pair in range(pairs):
            for viewed in (False, True) if pair % 2 == 0 else (True, False):
                with ExitStack() as stack:
                    if viewed:
                        stack.enter_context(page(browser, domain, drawn))
                    found[viewed].append(run(seconds, domain))
        browser.close()
    print(f"{pairs} pairs of {seconds} s in turn: median, and range")
    print("| what the servo notices | without page | with page | with less without | noise | within noise |")
    print("\n".join(["|---|---|---|---|---|---|", *(row(name, found) for name in FIGURES)]))
    print(f"frames drawn per second at the end, viewer's share of a core [%]: {drawn}")
