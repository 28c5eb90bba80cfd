# SPDX-License-Identifier: Apache-2.0
"""A running demo with its page, a real Chromium before it, and an ear that keeps what the others say."""

import contextlib
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import rclpy
import waiting
from axe_playwright_python.sync_playwright import Axe
from chromium import OPTIONS, find
from playwright.sync_api import sync_playwright
from rclpy.context import Context

from haptic_device.message_fields import truth_names
from haptic_device.nodes.messages import STREAM
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.process import ending_with_us
from haptic_device.recording.layouts import JOINTS, JointLayout

SHOTS = Path(__file__).parents[2] / "build" / "browser"
HARM = ("moderate", "serious", "critical")  # of what axe finds
POINT = Path(__file__).parents[1] / "busy.yaml"
PATIENCE, COMPILING = 120.0, 180.0  # s for what a busy machine does in one, and with kernels that nobody has used yet


def pytest_collection_modifyitems(items):
    """Pages without nodes come first: nodes take both cores from then on."""
    items.sort(key=lambda item: "system" in item.fixturenames)


class System:
    """`haptic demo --view` as a process in a terminal; `address` and `looking` as it printed them."""

    def __init__(self, folder: Path):
        self.folder = folder
        command = [sys.executable, "-m", "haptic_display.cli.main", "demo", "--view", "--out", str(folder / "run")]
        command += ["--params", str(POINT), "--port", "0"]
        self._keys, terminal = pty.openpty()
        self.process = subprocess.Popen(
            ending_with_us(command),
            stdin=terminal,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=folder,
        )
        os.close(terminal)
        limit = threading.Timer(COMPILING, self.process.kill)
        limit.start()
        try:
            self.address, self.looking = self._read("open"), self._read("only:")
        finally:
            limit.cancel()
        threading.Thread(target=self.process.stdout.read, daemon=True).start()

    def _read(self, word):
        said = []
        for line in self.process.stdout:
            said.append(line)
            if found := re.search(rf"{word} (http://\S+)", line):
                return found.group(1)
        self.process.wait(PATIENCE)
        raise AssertionError(f"haptic demo --view ended without an address: {''.join(said)}")

    def press(self, key):
        """A key of its terminal."""
        os.write(self._keys, key.encode())

    def end(self):
        """Its exit code; a process that does not end in time is killed."""
        self.process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(PATIENCE)
        self.process.kill()
        return self.process.wait(PATIENCE)


class Listener:
    """Keeps truths with the times [s, CLOCK_MONOTONIC] to which they belong, in a thread of its own."""

    def __init__(self, domain):
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("listener", namespace="/haptic", context=self._context)
        self._truths = PolledSubscription(self._node, "operator/state", JOINTS, STREAM, raw=True)
        self._layout, self.truths = JointLayout(truth_names(3)), []
        self._thread, self._over = threading.Thread(target=self._listen, daemon=True), False
        self._thread.start()

    def _listen(self):
        while not self._over:
            for sample in self._truths.take():
                truth = self._layout.unpack(sample.message)
                self.truths.append((truth.position[7], truth))
            time.sleep(0.001)

    def marked(self):
        """Namespaces of the next markers, with the frames they are in."""
        tap = PolledSubscription(self._node, "markers", "visualization_msgs/msg/MarkerArray", STREAM)
        found = self.until(tap.latest, "markers").message.markers
        tap.close()
        return {marker.ns for marker in found}, {marker.header.frame_id for marker in found}

    def motor(self):
        """(time, largest part of the motor's force) of everything heard."""
        return [(at, float(np.abs(truth.effort[3:6]).max())) for at, truth in list(self.truths)]

    def rested(self):
        """Where the hand wants to be, once it has wanted nothing else in 250 truths from now on."""
        begin = len(self.truths)

        def still():
            places = np.array([truth.position[3:6] for _, truth in self.truths[begin:][-250:]])
            return [places[-1]] if len(places) == 250 and np.ptp(places, axis=0).max() < 1e-9 else None

        return self.until(still, "the hand rests")[0]

    def later(self, count=500):
        """So many truths later than now."""
        since = len(self.truths)
        self.until(lambda: len(self.truths) > since + count, f"{count} truths")

    def until(self, found, what, seconds=PATIENCE):
        """The first true answer of found(); what: is waited for."""
        return waiting.until(found, what, limit=seconds)

    def close(self):
        self._over = True
        self._thread.join(PATIENCE)
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture(scope="session")
def listener(ros_domain):
    ear = Listener(ros_domain)
    yield ear
    ear.close()


@pytest.fixture(scope="session")
def system(listener, tmp_path_factory):
    running = System(tmp_path_factory.mktemp("viewed"))
    yield running
    assert running.end() == 0


@pytest.fixture(scope="session")
def chromium():
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=find(), args=list(OPTIONS), timeout=1e3 * PATIENCE)
        yield browser
        browser.close()


UNFOLDED = '{"walls": true, "tuning": true, "recording": true}'


class Tab:
    """A page with what people look at, experts with all panels open unless said otherwise; `complaints` is what it
    wrote to the console."""

    def __init__(self, browser, width=1280, height=720, expert=True, folded=False, **given):
        self.page = browser.new_page(viewport={"width": width, "height": height}, **given)
        if not folded:
            self.page.add_init_script(f"localStorage.folds ??= {UNFOLDED!r}")
        if expert:
            self.page.add_init_script("localStorage.layer ??= 'expert'")
        self.page.set_default_timeout(1e3 * PATIENCE)
        self.complaints = []
        self.page.on("console", lambda line: self.complaints.append(line.text) if line.type == "error" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))

    def harm(self, part=None):
        """What axe finds moderate or worse in this part of the page, or in all of it: rule and elements."""
        found = Axe().run(self.page, part).response["violations"]
        return [(rule["id"], [node["target"] for node in rule["nodes"]]) for rule in found if rule["impact"] in HARM]

    def text(self, name):
        return self.page.text_content(f"#{name}")

    def until(self, script, seconds=PATIENCE, before=lambda: None):
        """Waits until the script's expression is true on the page; calls before() ahead of each look. Playwright's own
        waiting needs eval, which the page forbids."""
        waiting.until(
            lambda: not before() and self.page.evaluate(f"Boolean({script})"),
            script,
            look=lambda: self.page.wait_for_timeout(30),
            said=lambda: self.page.inner_text("body")[:4000],
            limit=seconds,
        )

    def until_text(self, name, pattern, seconds=PATIENCE):
        self.until(f"/{pattern}/.test(document.getElementById({name!r}).textContent)", seconds)

    def engage(self):
        """Clears a fault and engages, the hand at the scene's start."""
        self.page.click("[data-service=reset]")
        self.until("!/fault/.test(document.getElementById('state').textContent)")
        self.page.click("#start_scene")
        self.until_text("scene_answer", "at its start")
        self.page.click("[data-service=enable]")
        self.until_text("state", "^engaged$")

    def choose(self, box, option, said):
        """Chooses scene or method; waits for the answer, and until the motor is on again."""
        self.page.select_option(f"#{box}", option)
        self.until_text("scene_answer", said, COMPILING)
        self.until_text("state", "^engaged$")

    def middle(self):
        box = self.page.locator("#scene").bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def shot(self, name):
        SHOTS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=SHOTS / f"{name}.png")


class Cable:
    """Between a page and the viewer, to be cut and mended; the page opens `address`."""

    def __init__(self, address):
        url = urlsplit(address)
        self._far, self._ends, self.whole = (url.hostname, url.port), [], True
        self._plug = socket.create_server(("127.0.0.1", 0))
        self.address = address.replace(f":{url.port}/", f":{self._plug.getsockname()[1]}/")
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            near, _ = self._plug.accept()
            if not self.whole:
                near.close()
                continue
            far = socket.create_connection(self._far)
            self._ends += [near, far]
            for ends in ((near, far), (far, near)):
                threading.Thread(target=self._carry, args=ends, daemon=True).start()

    def _carry(self, one, other):
        with contextlib.suppress(OSError):
            while data := one.recv(65536):
                other.sendall(data)
        self._end(one, other)

    def _end(self, *ends):
        for end in ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def cut(self):
        self.whole = False
        self._end(*self._ends)


@pytest.fixture(scope="session")
def tab(chromium, system):
    """The first page, with control, once the nodes are up."""
    tab = Tab(chromium)
    tab.page.goto(system.address)
    tab.until("document.querySelectorAll('.tuned').length > 0")
    tab.until_text("state", "^engaged$")
    yield tab
    tab.page.close()
