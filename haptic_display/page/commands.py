# SPDX-License-Identifier: Apache-2.0
"""Does what pages ask for. What goes wrong is a ValueError with a sentence for whoever asked."""

import asyncio
import contextlib
import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from haptic_device.config.description import Device, load_device
from haptic_device.config.parameter_files import Values
from haptic_device.nodes.fault_answers import latched
from haptic_device.nodes.messages import TRACE, String
from haptic_display.client import Client
from haptic_display.page import messages, settings
from haptic_display.page.guide import Guide
from haptic_display.page.hand import THERE, Hand, Limits
from haptic_display.page.leading_page import LeadingPage
from haptic_display.page.loading import point_in
from haptic_display.page.recovery import Recovery
from haptic_display.page.scene_controller import SceneController
from haptic_display.page.settings import DRIVER, LOOPBACK, RECORDER, SIMULATION
from haptic_display.page.state import State
from haptic_display.page.trouble import TroubleFinder
from haptic_display.page.waiting import STARTING, until
from haptic_display.service_requests import Question, change_state, get_parameters, set_parameters, state_of, trigger

if TYPE_CHECKING:  # what it can do without
    from haptic_display.page.node_manager import NodeManager
    from haptic_display.page.session import Session

UNCONFIGURED, INACTIVE, ACTIVE = 1, 2, 3  # lifecycle states
CONFIGURE, ACTIVATE, DEACTIVATE = 1, 3, 4  # lifecycle transitions
STOPPING = ("estop", "disable")
BEGINNING = ("play", "step")  # of the guide
YIELDED = 5e-4  # [m, rad] between the hand's target and the handle, by which it pulls at nothing that is felt
EDGE = 0.01  # of the workspace at either end is where a page leads no hand
LEADING = (messages.LoadScene, messages.ChooseMethod, messages.StartScene, messages.Mend)  # lead the hand to a place
WAITING = (*LEADING, messages.Aim, messages.TakeOver, messages.Restart)  # need motor and hand for themselves
ENDING = (*WAITING, messages.Trigger)  # after these the guide shows nothing more
RESTARTING = "the nodes are being started again"
SLOW = (0.2, 3.0)  # m/s, rad/s at most, with which the hand is led to where a scene begins
AGAIN, PATIENCE = 0.4, 4.8  # s: a busy machine may hold a node up for seconds
POLLED = 0.4  # s for an answer that is asked for every second anyway
BAG = 20.0  # s that a recorder may take to open or close a bag


class CommandHandler:
    """Owns the hand. `values` are the nodes' parameters as last polled: {node: {name: value}}.

    began: the driver's live ones as they were first heard.
    held_off: whether a page has said that the motor shall be off. drove: whether it was on before a node ended.
    doing: the sequence that has motor and hand for itself, in words; "" if there is none.

    nodes: those that are this process's to start again; else None.
    """

    def __init__(self, client: Client, state: State, speeds: tuple[float, float], nodes: "NodeManager | None" = None):
        self.client, self.state, self.hand, self._nodes = client, state, Hand(), nodes
        self.values: Values = {}
        self.device: Device | None = None
        self.problem, self.held_off = "", False
        self.began: dict[str, Any] = {}
        self.drove, self.doing = False, ""
        self.scenes, self.pages, self.recovery = SceneController(self), LeadingPage(self), Recovery(self, nodes)
        self.guide = Guide(self)
        self.troubles = TroubleFinder(state, client, nodes)
        self._speeds, self._asked_device = speeds, ""
        self._marks = client.node.create_publisher(String, "mark", TRACE)
        self._prepare()

    @property
    def driving(self) -> bool:
        """Whether the motor is on, or waits for a small force, as the driver last said."""
        return self.state.said(DRIVER, "state", "idle") not in ("idle", "fault")

    @property
    def fault(self) -> str:
        """Name of the fault that is latched, as the driver last said; "" if none is."""
        return self.state.said(DRIVER, "fault") if self.state.said(DRIVER, "state") == "fault" else ""

    @property
    def arrived(self) -> bool:
        """Whether the hand's target, as the device last said it, is where a page wants it to be."""
        truth, hand = self.state.truth, self.hand
        if truth is None or hand.goal is None:
            return False
        there = zip(self.state.to_world(truth.target), hand.goal, range(self.state.axes), strict=False)
        return all(abs(place - goal) < THERE for place, goal, _ in there)

    @property
    def inside(self) -> bool:
        """Whether the handle is in the device's workspace, as far as both are known."""
        if self.state.truth is None or self.workspace is None:
            return True
        place = self.state.to_world(self.state.truth.position)
        return all(low <= at <= high for at, (low, high) in zip(place, self.workspace, strict=False))

    @property
    def yielded(self) -> bool:
        """Whether the hand's target is where the handle is, or no hand is heard of."""
        truth = self.state.truth
        return truth is None or math.dist(truth.position, truth.target) < YIELDED

    @property
    def workspace(self) -> tuple[tuple[float, float], ...] | None:
        """Of each axis, in the world [m, m, rad]; None without a description of the device."""
        if not isinstance(self.device, Device):
            return None
        length, angle = self.device.scale
        axes = zip((length, length, angle), self.device.axes, strict=False)
        return tuple((scale * axis.workspace[0], scale * axis.workspace[1]) for scale, axis in axes)

    @property
    def limits(self) -> Limits:
        """Where the hand may go in the world, and speeds; without a description of the device, a workspace of 1 m.

        It keeps off the ends, beyond which the driver has a fault: a hand swings past where it wants to be."""
        speeds = map(min, self._speeds, SLOW) if self.doing else self._speeds
        if self.workspace is None:
            return Limits(((-0.5, 0.5),) * 2 + ((-100.0, 100.0),), *speeds)
        ends = tuple((low + EDGE * (high - low), high - EDGE * (high - low)) for low, high in self.workspace)
        return Limits(ends, *speeds)

    async def do(self, message: messages.Message, session: "Session | None") -> str:
        """Does it for a page; returns the sentence that says what was done, "" if there is nothing to say."""
        self._admit(message, session)
        match message:
            case messages.Aim():
                return self.pages.follow(session, message.place)
            case messages.LetGo():
                return self.pages.let_go(session)
            case messages.TakeOver():
                return self.pages.take_over(session)
            case messages.Trigger():
                return await self._trigger(message.service)
            case messages.SetAll():
                return await self._set_all(message.values)
            case messages.LoadScene():
                return await self.scenes.load(message.name)
            case messages.ChooseMethod():
                return await self.scenes.choose_method(message.name)
            case messages.StartScene():
                return await self.scenes.start_again()
            case messages.ShowWay():
                return await self.guide.do(message.act)
            case messages.Mark():
                return self._mark(message.text)
            case messages.Record():
                return await self._record(message.on)
            case messages.Mend():
                return await self.recovery.mend(self.troubles.trouble, message.title)
            case messages.Restart():
                return await self._restart(message.name, message.value)
        return ""

    def _admit(self, message: messages.Message, session: "Session | None") -> None:
        """ValueError if the page may not do this now. Else the page is the one to be listened for, if the hand is led
        for it, and the guide ends, if the message ends it."""
        begins = isinstance(message, messages.ShowWay) and message.act in BEGINNING
        if self.doing and (begins or isinstance(message, WAITING)):
            raise ValueError(f"wait: {self.doing}")
        if isinstance(message, messages.Aim | messages.ShowWay):
            self.pages.check(session)
        if isinstance(message, (*LEADING, messages.ShowWay)):
            self.pages.keeper = session
        if isinstance(message, ENDING):
            self.guide.stop()

    @contextlib.contextmanager
    def alone(self, doing: str) -> Iterator[None]:
        """For a sequence that drives motor and hand: while it runs there is no other. ValueError if there is one."""
        if self.doing:
            raise ValueError(f"wait: {self.doing}")
        self.doing = doing
        try:
            yield
        finally:
            self.doing = ""

    def check_wanted(self, fault: str) -> None:
        """ValueError if a page has said that the motor shall be off, or another fault than this is latched."""
        if self.fault not in ("", fault):
            raise ValueError(latched(self.fault))
        if self.held_off:
            raise ValueError("the display has been stopped: press Engage to go on")

    async def poll(self) -> None:
        """Asks the nodes for their parameters; nodes that are not heard any more keep none."""
        for node in settings.NODES:
            try:
                self.values[node] = await self._parameters(node, POLLED, None)
                self.began = self.began or settings.live_of(self.values.get(DRIVER, {}))
            except ValueError:
                if node not in self.state.statuses:
                    self.values.pop(node, None)
        named = self.values.get(DRIVER, self.values.get(LOOPBACK, {})).get("device")
        if named and named != self._asked_device:
            self._asked_device = named
            self._describe(named)
        if self._nodes is not None:
            self._nodes.keep(self.values)

    async def heard(self) -> Values:
        """The parameters of the nodes that are heard, asked for now. ValueError: one does not say its own, or none is
        heard."""
        if not self.state.statuses:
            raise ValueError("no node is heard of")
        return {node: await self._parameters(node) for node in settings.NODES if node in self.state.statuses}

    async def _parameters(self, node: str, *patience: Any) -> dict[str, Any]:
        return await self.ask(get_parameters(node, [parameter.name for parameter in settings.NODES[node]]), *patience)

    async def ask(
        self, question: Question, patience: float = PATIENCE, again: float | None = AGAIN, wait: bool = False
    ) -> Any:
        """What a node's answer means; ValueError if it refuses, is not there, or is silent."""
        return await self.client.acall(question, patience=patience, again=again, wait=wait)

    async def order(self, service: str) -> str:
        """enable, disable, estop or reset of the driver. Only what stops is asked for again and again: a late second
        request to go would undo a stop that came after the first."""
        stops = service in STOPPING  # asked of a driver that the graph does not show, too
        return await self.ask(trigger(f"{DRIVER}/{service}"), again=AGAIN if stops else None, wait=stops)

    def lead(self, now: float) -> None:
        """Leads the hand on towards its goal, or lets go when the page that led it is silent; to be called often. now
        [s]."""
        self._remember()
        if not self.state.axes:
            self.guide.stop()
            self.hand.release()
            return
        self.guide.lead(now)
        truth, to_world = self.state.truth, self.state.to_world
        self.hand.listen(now, self.pages.heard)
        place = self.hand.lead(now, self.limits)
        if self.hand.loose and truth:
            place = self.hand.give_in(now, to_world(truth.position), to_world(truth.target), self.limits)
        if place is not None:
            self.client.aim(place)

    def aim(self, place: dict[str, float]) -> str:
        """Where the hand shall go [m, m, rad]; returns the hint if it was clamped. ValueError if there is no hand."""
        if not self.state.axes or (truth := self.state.truth) is None:
            raise ValueError("no simulated hand is heard of: haptic_loopback does not run")
        motion = self.values.get(LOOPBACK, {}).get("motion.name", "follow")
        if motion != "follow":
            raise ValueError(f"the hand plays the script {motion}; start haptic_loopback with motion.name: follow")
        now = time.monotonic()
        if self.hand.goal is None:
            self.hand.take(self.state.to_world(truth.target), now)
        hint = self.hand.aim(place, self.limits)
        self.lead(now)
        return hint

    def let_go(self) -> None:
        """The hand pulls at nothing, and no page leads it."""
        self.hand.let_go(time.monotonic())

    def _remember(self) -> None:
        """Of what the driver says while a node has ended, or its device is silent for that, nothing."""
        trouble = self.troubles.trouble
        if trouble is None or trouble.fault not in ("", "device_silent"):
            self.drove = self.driving

    def _prepare(self) -> None:
        """Services are looked for before they are needed: an e-stop must not wait for its own to be found."""
        self.client.prepare(*(f"{DRIVER}/{service}" for service in messages.SERVICES))
        self.client.prepare(*(f"{SIMULATION}/{service}" for service in ("load_scene", "reset_scene")))
        self.client.prepare(*(f"{node}/get_parameters" for node in settings.NODES))
        self.client.prepare(*(f"{node}/set_parameters_atomically" for node in (DRIVER, SIMULATION)))
        self.client.prepare(f"{RECORDER}/get_state", f"{RECORDER}/change_state")

    def _describe(self, name: str) -> None:
        try:
            self.device, self.problem = load_device(name), ""
            self.state.scale = self.device.scale
        except (ValueError, OSError) as error:
            self.device, self.problem = None, f"the device's workspace is not known: {error}"

    async def _trigger(self, service: str) -> str:
        if service != "reset":
            self.held_off = service != "enable"
        if service == "estop" and not self.scenes.changing:
            self.let_go()
        return await self.order(service)

    async def _set_all(self, values: dict[str, Any]) -> str:
        values = {name: settings.typed(name, value) for name, value in values.items()}
        await self.ask(set_parameters(DRIVER, values))
        await self.poll()
        return ", ".join(f"{name} is {value}" for name, value in values.items())

    async def load(self, file: bytes) -> str:
        """Sets what a parameter file asks for of the driver, all or nothing; names what it changed, and what differs
        and was not set. Raises ValueError, one sentence."""
        namespace, running = self.client.node.get_namespace(), await self.heard()
        point = await asyncio.to_thread(point_in, file, namespace, running)  # an e-stop does not wait for a long file
        await self._set_all(point.live)
        return point.sentence

    def _mark(self, text: str) -> str:
        if not self._marks.get_subscription_count():
            raise ValueError("nobody records: the mark is kept nowhere")
        self._marks.publish(String(data=text))
        return f"mark set: {text}"

    async def _record(self, on: bool) -> str:
        state = await self.ask(state_of(RECORDER))
        steps = {UNCONFIGURED: (CONFIGURE, ACTIVATE), INACTIVE: (ACTIVATE,)} if on else {ACTIVE: (DEACTIVATE,)}
        for step in steps.get(state, ()):
            await self.ask(change_state(RECORDER, step), BAG, None)
        return "recording" if on else "the bag is closed"

    async def _restart(self, name: str, value: Any) -> str:
        if self._nodes is None:
            raise ValueError(f"{name} is fixed once the nodes run; haptic demo --view starts them again for it")
        with self.alone(RESTARTING):
            self.held_off = self.held_off or bool(self.fault)  # else a stop would be over with the driver it stopped
            enable = not self.held_off
            self.hand.release()
            said = await self._nodes.change(name, value, enable)
            self.client.statuses.clear()  # of nodes that have ended
            self.state.look()  # else the page would read the answer beside their last states
            if enable and await until(lambda: DRIVER in self.state.statuses, STARTING) and self.held_off:
                await self.order("disable")  # stopped while there was no driver to hear it
        return said
