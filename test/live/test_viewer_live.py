# SPDX-License-Identifier: Apache-2.0
"""The viewer as a process and as a node of this one: what it prints, what it leaves, and a hand that it lets go."""

import asyncio
import contextlib
import sys
import threading

import aiohttp
import pytest
import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions
from waiting import LIMIT, until

from haptic_device.message_fields import truth_names
from haptic_device.nodes import messages
from haptic_device.nodes.polled_subscription import PolledSubscription
from haptic_device.nodes.ros_parameters import declare
from haptic_device.recording.layouts import JOINTS, JointLayout
from haptic_display.client import Client
from haptic_display.page import hand as hand_of_a_page
from haptic_display.page import viewer
from haptic_display.service_requests import get_parameters
from haptic_sim.node import parameters as node_parameters


def opened(session, server):
    """A page's socket with control."""
    address = server.address(True)
    origin = f"http://{address.split('/')[2]}"
    return session.ws_connect(address.replace("http", "ws") + "socket", headers={"Origin": origin})


def test_a_viewer_that_is_open_to_others_warns_before_it_prints_its_address(start, tmp_path):
    command = [sys.executable, "-m", "haptic_display.cli.main", "view", "--host"]
    for host in ("0.0.0.0", "127.0.0.1"):
        with open(tmp_path / host, "w") as log:
            start([*command, host], stdout=log, stderr=log)
    for host in ("0.0.0.0", "127.0.0.1"):
        said = (tmp_path / host).read_text
        until(lambda said=said: "open http" in said(), f"the address of a viewer on {host}", said=said)
        warned = f"WARNING: it listens on {host}, in plain text" in said().partition("open http")[0]
        assert warned is (host == "0.0.0.0")


def test_a_viewer_has_no_thread_of_its_own_left_when_its_node_is_destroyed_which_is_before_ros_is_left(monkeypatch):
    destroyed, before = [], set(threading.enumerate())

    class Kept(rclpy.node.Node):
        def destroy_node(self):
            destroyed.append((set(threading.enumerate()) - before, rclpy.ok()))
            super().destroy_node()

    monkeypatch.setattr(viewer, "Node", Kept)
    viewer.serve(["--ros-args", "--disable-external-lib-logs"], iter((False, False, True)).__next__)
    assert destroyed == [(set(), True)] and not rclpy.ok()


@pytest.fixture
def shown(ros_domain):
    """A viewer on a node of this process, and the context of that node."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("haptic_viewer", namespace="/haptic", context=context)
    try:
        yield viewer.Viewer(node, declare(node, node_parameters.NODES["haptic_viewer"]) | {"port": 0}), context
    finally:
        node.destroy_node()
        context.shutdown()


def test_the_parameters_of_a_viewer_can_be_asked_for_while_it_serves(shown, ros_domain):
    async def live(served):
        over = []
        running = asyncio.create_task(served.run(lambda: over))
        with contextlib.closing(Client.join("asks", ros_domain, "/haptic")) as client:
            found = await client.acall(get_parameters("haptic_viewer", ["rate", "host"]), patience=LIMIT)
        over.append(True)
        await running
        return found

    assert asyncio.run(asyncio.wait_for(live(shown[0]), LIMIT)) == {"rate": 60.0, "host": "127.0.0.1"}


def test_a_look_at_the_values_that_fails_is_not_the_last(shown):
    viewed, looks, over = shown[0], [], []

    async def scan():
        looks.append(len(looks))
        if len(looks) == 3:
            over.append(True)
        raise OSError("the disk is gone")

    viewed.recordings.scan = scan
    asyncio.run(asyncio.wait_for(viewed.run(lambda: over), LIMIT))
    assert looks == [0, 1, 2]


class Pulled:
    """A device whose handle does not follow its hand: it tells where that wants to be."""

    def __init__(self, context):
        self.target, self._node = (0.0, 0.0, 0.0), rclpy.create_node("pulled", namespace="/haptic", context=context)
        self._targets = PolledSubscription(self._node, "operator/target", JOINTS, messages.LATEST)
        self._layout = JointLayout(truth_names(3))
        self._truths = self._node.create_publisher(messages.JointState, "operator/state", messages.STREAM)

    def close(self):
        self._node.destroy_node()

    async def wants_to_be_at(self, x):
        while self.target[0] != x:
            if sample := self._targets.latest():
                self.target = tuple(sample.message.position)
            self._truths.publish(self._layout.pack(0, (0.0,) * 3 + self.target + (0.0,) * 3, (0.0,) * 9, (0.0,) * 9))
            await asyncio.sleep(0.01)


@pytest.mark.parametrize("ends", ("gone", "silent"))
def test_the_hand_lets_go_when_the_page_that_led_it_is(ends, shown, monkeypatch):
    monkeypatch.setattr(hand_of_a_page, "SILENCE", 0.2)

    async def live(served, device):
        over = []
        running = asyncio.create_task(served.run(lambda: over))
        while ":0/" in served.server.address(True):
            await asyncio.sleep(0.01)
        async with aiohttp.ClientSession() as session, opened(session, served.server) as other:
            page = await opened(session, served.server)
            following = asyncio.create_task(device.wants_to_be_at(0.05))
            while not following.done():
                await page.send_str('{"do": "aim", "x": 0.05}')
                await asyncio.sleep(0.05)
            if ends == "gone":
                await page.close()
            following = asyncio.create_task(device.wants_to_be_at(0.0))
            while not following.done():  # another page, which has not led the hand, is no reason to go on
                await other.send_str('{"do": "seen", "frame": 0}')
                await asyncio.sleep(0.05)
            over.append(True)
            await running

    served, context = shown
    with contextlib.closing(Pulled(context)) as device:
        asyncio.run(asyncio.wait_for(live(served, device), LIMIT))
