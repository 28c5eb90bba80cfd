# SPDX-License-Identifier: Apache-2.0
"""haptic_viewer: looks at the running nodes, shows them to the pages, and passes on what the pages ask for."""

if __name__ == "__main__":  # before the imports, which take seconds
    from haptic_device.process import start

    raise SystemExit(start(__spec__.name))

import asyncio
import contextlib
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from haptic_device.config.files import names
from haptic_device.nodes.lifecycle import hear_the_end
from haptic_device.nodes.ros import begin_ros, made, refuse_files_of_others
from haptic_device.nodes.ros_parameters import declare
from haptic_device.os_errors import in_words
from haptic_device.process import say
from haptic_device.realtime.scheduling import spare_collections
from haptic_display.client import Client
from haptic_display.page import settings
from haptic_display.page.commands import CommandHandler
from haptic_display.page.guard import is_loopback
from haptic_display.page.linkage import linkage_facts
from haptic_display.page.markers import MarkerPublisher
from haptic_display.page.messages import Aim, LetGo, Message, Record, Trigger
from haptic_display.page.page_words import in_page_words
from haptic_display.page.passive_range import PassiveRanges
from haptic_display.page.recordings import Recordings
from haptic_display.page.server import Server
from haptic_display.page.session import Session
from haptic_display.page.settings import DRIVER, RECORDER, SIMULATION
from haptic_display.page.state import State
from haptic_display.page.tasks import tasks
from haptic_display.page.trouble import Trouble
from haptic_display.page.unfelt import unfelt
from haptic_sim.method_registry import AUTO, offered
from haptic_sim.node.parameters import NODES

if TYPE_CHECKING:  # it starts nodes, which is not for every viewer
    from haptic_display.page.node_manager import NodeManager

Said = Callable[[], object]  # true or false
STATUS_PERIOD, POLL_PERIOD = 0.25, 1.0  # s
STOP = Trigger(service="estop")


class Viewer:
    """A viewer on a node that it may use alone. nodes: the nodes, where they are this process's to start again: has
    offer(), changing, ended(), keep(values), async change(name, value, enable) and async start_again(names)."""

    def __init__(self, node: Node, values: dict[str, Any], nodes: "NodeManager | None" = None):
        client = Client(node)
        self.state, self._client, self._nodes = State(client), client, nodes
        self._unfelt = {"words": "", "todo": ""}
        self.commands = CommandHandler(client, self.state, (values["hand_speed"], values["hand_turn"]), nodes)
        self._markers = MarkerPublisher(node, values["marker_rate"])
        self.recordings = Recordings(self._tell_recordings)
        given = self._welcome, self._do, self._save, self.commands.load, self.recordings.film
        self.server = Server(values["host"], values["port"], *given)
        self._ranges = PassiveRanges(self.state)
        self._node, self._values, self._executor = node, values, SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._scene_told, self._status_due, self._figures = 0, 0.0, dict[str, float]()
        self._state_told: tuple[str, Trouble | None, str] | None = None
        self._leader_told: Session | None = None
        self._cpu, self._cpu_at, self._sent = time.process_time(), time.monotonic(), 0

    async def run(self, told: Said, stop: Said | None = None) -> None:
        """Serves until told() is true; stop(), if there is one: whether somebody wants an e-stop now."""
        try:
            await self.server.start()
            spare_collections()  # one of them would hold up an e-stop
            self._announce("space here, " if stop else "")
            polling = asyncio.create_task(self._poll())
            await self._look_on(told, stop or (lambda: False))
            polling.cancel()
        finally:
            await self.server.stop()
            self._executor.shutdown()

    async def _look_on(self, told: Said, stop: Said) -> None:
        period, due, stops = 1.0 / self._values["rate"], time.monotonic(), set()
        while not told():
            due = max(due + period, time.monotonic())
            await asyncio.sleep(due - time.monotonic())
            if stop():
                stops.add(asyncio.create_task(self._stop()))
            self.state.look()
            self.commands.troubles.look(self.commands.recovery.running)
            self.commands.lead(time.monotonic())
            frame = self.state.frame()
            self._unfelt = unfelt(self.state, frame, SIMULATION in self._client.statuses)
            self.server.show(frame)
            self._markers.show(self.state.scene, frame, *self._surroundings(), time.monotonic())
            self._tell_leader()
            self._tell_news(time.monotonic())

    def _tell_news(self, now: float) -> None:
        if self.state.scene_number != self._scene_told:
            self._scene_told = self.state.scene_number
            self.server.tell("scene", self._scene())
        if said := self.commands.troubles.news():
            say(f"haptic_viewer: {said}")
        state = (self.state.said(DRIVER, "state"), self.commands.troubles.trouble, self._unfelt["words"])
        if now >= self._status_due:
            self._answer_ros()
        if now >= self._status_due or state != self._state_told:
            self._state_told = state
            self._tell_status(now)

    async def _stop(self) -> None:
        try:
            said = await self.commands.do(STOP, None)
        except ValueError as refusal:
            said = str(refusal)
        say(f"e-stop: {said}")

    def _tell_leader(self) -> None:
        """Each page whether it leads the hand, when that changes. A page that has gone leads no more."""
        hand, sessions = self.commands.hand, self.server.sessions
        hand.leader = hand.leader if hand.leader in sessions else None
        if hand.leader is not self._leader_told:
            self._leader_told = hand.leader
            for session in sessions:
                session.tell("leader", self._leads(session))

    def _leads(self, session: Session) -> str:
        leader = self.commands.hand.leader
        return "none" if leader is None else "you" if leader is session else "other"

    def _answer_ros(self) -> None:
        """One request to this node's own services of parameters, if one waits."""
        try:
            self._executor.spin_once(timeout_sec=0.0)
        except Exception as error:  # one request that cannot be read is not the end of the pages
            self._node.get_logger().error(f"a request could not be answered: {type(error).__name__}: {error}")

    def _tell_status(self, now: float) -> None:
        self._status_due = now + STATUS_PERIOD
        self.recordings.hear(self.state.statuses.get(RECORDER))
        self.server.tell("status", self._status())

    async def _poll(self) -> None:
        while True:
            try:
                await self._look_closer()
            except Exception as error:  # one look that fails is not the end of the next
                self._node.get_logger().error(f"values could not be looked at: {type(error).__name__}: {error}")
            await asyncio.sleep(POLL_PERIOD)

    async def _look_closer(self) -> None:
        """Values, ranges and recordings: what changes seldom."""
        with contextlib.suppress(ValueError):
            await self.commands.poll()
        await self._ranges.follow(self.commands.device, self.commands.values.get(DRIVER, {}))
        self.server.tell("values", self._tuning())
        await self.recordings.scan()

    async def _do(self, message: Message, session: Session) -> str:
        done = self.commands.do(message, session)
        try:
            done = self.recordings.during(message.on, done) if isinstance(message, Record) else done
            sentence = in_page_words(await done)
        except ValueError as refusal:
            raise ValueError(in_page_words(str(refusal))) from None
        if not isinstance(message, Aim | LetGo):
            self._tell_status(time.monotonic())  # before the answer, which is read in its light
            self.server.tell("values", self._tuning())
        return sentence

    def _welcome(self, session: Session) -> None:
        """All that a page has to know to begin with: it may have been here before, or come late."""
        choices = {"scenes": names("scenes"), "tasks": tasks(), "methods": [AUTO, *offered()]}
        page = {"control": session.control, "looking": self.server.address(False)}
        session.tell("hello", {**page, "declarations": settings.declarations(), **choices})
        session.tell("leader", self._leads(session))
        session.tell("scene", self._scene())
        session.tell("values", self._tuning())
        session.tell("status", self._status())
        session.tell("recordings", self.recordings.news())

    def _tell_recordings(self) -> None:
        self.server.tell("recordings", self.recordings.news())

    def _scene(self) -> dict[str, Any] | None:
        return asdict(self.state.scene) if self.state.scene else None

    def _surroundings(self) -> tuple[list[tuple[float, float, float]], tuple[tuple[float, float], ...] | None]:
        """The servo's walls, and the device's workspace in the world; None where it is not known."""
        return settings.walls(self.commands.values.get(DRIVER, {})), self.commands.workspace

    def _tuning(self) -> dict[str, Any]:
        device = self.commands.device
        name, axes = (device.name, device.axes) if device else (None, ())
        told = {"values": self.commands.values, "began": self.commands.began, "workspace": self.commands.workspace}
        of_device = {"device": name, "damping": [axis.damping for axis in axes], "linkage": linkage_facts(device)}
        return {**told, "offer": self._nodes.offer() if self._nodes else {}, "passive": self._ranges.found, **of_device}

    def _status(self) -> dict[str, Any]:
        found = {
            name: {"level": status.level, "message": status.message, "values": status.values}
            for name, status in self.state.statuses.items()
        }
        trouble, problem = self.commands.troubles.trouble, self.state.problem or self.commands.problem
        wrong = {"problem": problem, "trouble": trouble and trouble._asdict(), "unfelt": self._unfelt}
        return {"nodes": found, **wrong, "guide": self.commands.guide.said, "viewer": self._own_figures()}

    def _own_figures(self) -> dict[str, float]:
        """Share of a core that this process takes, pages, frames sent per second to all of them."""
        now, cpu, sent = time.monotonic(), time.process_time(), sum(session.sent for session in self.server.sessions)
        elapsed = max(1e-3, now - self._cpu_at)
        if elapsed > 1.0 or not self._figures:
            pages, rate = len(self.server.sessions), max(0.0, (sent - self._sent) / elapsed)
            self._figures = {"cpu": (cpu - self._cpu) / elapsed, "pages": pages, "sent": rate}
            self._cpu, self._cpu_at, self._sent = cpu, now, sent
        return self._figures

    async def _save(self) -> str:
        return settings.operating_point(self._node.get_namespace(), await self.commands.heard())

    def _announce(self, here: str) -> None:
        host = self._values["host"]
        self._node.get_logger().info(f"serving pages on {host}, of the nodes in {self._node.get_namespace()}")
        if not is_loopback(host):
            say(
                f"haptic_viewer: WARNING: it listens on {host}, in plain text: whoever sees the address below on the "
                "network can move the handle"
            )
        for note in self.server.notes:
            say(f"haptic_viewer: {note}")
        ways = f"open {self.server.address(True)}", f"view-only: {self.server.address(False)}"
        for one in (*ways, f"e-stop: {here}Esc on any page"):
            print(f"haptic_viewer: {one}\n", end="", flush=True)  # no log comes between an address and its newline


def serve(args: list[str] | None, told: Said, nodes: "NodeManager | None" = None, stop: Said | None = None) -> None:
    """A viewer with these ROS arguments until told() is true; stop() asks for an e-stop. ValueError, OSError to
    refuse."""
    node = None
    try:
        begin_ros(args)
        node = made(lambda: Node("haptic_viewer"))
        refuse_files_of_others(node, "haptic_viewer", args)
        asyncio.run(Viewer(node, declare(node, NODES["haptic_viewer"]), nodes).run(told, stop))
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def main(args: list[str] | None = None, stop: Said | None = None) -> int:
    """Runs haptic_viewer until SIGINT, SIGTERM or SIGHUP; stop() asks for an e-stop. Exit code 1 on a refusal."""
    told = hear_the_end()
    try:
        serve(args, lambda: told, stop=stop)
    except (ValueError, OSError) as refusal:
        say(f"haptic_viewer: {in_words(refusal)}")
        return 1
    return 0
