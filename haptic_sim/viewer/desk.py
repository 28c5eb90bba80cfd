# SPDX-License-Identifier: Apache-2.0
"""Does what pages ask for: one method a wish. What goes wrong is a ValueError with a sentence for whoever asked."""

import time

from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from std_srvs.srv import Trigger

from haptic_device.description import AXES, Device, load_device
from haptic_device.nodes.messages import LATEST, TRACE, JointState, String
from haptic_sim.viewer import tuned, wishes
from haptic_sim.viewer.feed import Feed
from haptic_sim.viewer.hand import THERE, Hand, Limits
from haptic_sim.viewer.services import ANSWER, ATTEMPTS, Services
from haptic_sim.viewer.stage import DRIVER, LOOPBACK, SIMULATION, Stage

RECORDER = "haptic_recorder"
UNCONFIGURED, INACTIVE, ACTIVE = 1, 2, 3  # lifecycle states
CONFIGURE, ACTIVATE, DEACTIVATE = 1, 3, 4  # lifecycle transitions
STOPPING = ("estop", "disable")
EDGE = 0.01  # of the workspace at either end is where a page leads no hand
LEADING = ("aim", "scene", "method", "start_scene", "compare")  # wishes that move the hand
BAG = 20.0  # s that a recorder may take to open or close a bag


class Desk:
    """Owns the hand and the services. `values` are the nodes' parameters as last polled: {node: {name: value}}.

    held_off: whether a page has said that the motor shall be off.

    company: the nodes, where they are this process's to start again; else None.
    """

    def __init__(self, node, feed: Feed, speeds: tuple[float, float], company=None):
        self.feed, self.services, self.hand, self._company = feed, Services(node), Hand(), company
        self.values, self.device, self.problem, self.held_off = {}, None, "", False
        self.stage = Stage(self)
        self._speeds, self._asked_device, self._leader = speeds, None, None
        self._target = node.create_publisher(JointState, "operator/target", LATEST)
        self._marks = node.create_publisher(String, "mark", TRACE)
        self._does = {
            "aim": self._aim,
            "trigger": self._trigger,
            "set": self._set,
            "mark": self._mark,
            "record": self._record,
            "restart": self._restart,
            "scene": self.stage.load,
            "method": self.stage.take_method,
            "start_scene": self.stage.start_again,
            "compare": self.stage.set_beside,
        }
        self._prepare()

    @property
    def driving(self) -> bool:
        """Whether the motor is on, or waits for a small force, and no page has said otherwise."""
        return not self.held_off and self.feed.said(DRIVER, "state", "idle") not in ("idle", "fault")

    @property
    def arrived(self) -> bool:
        """Whether the hand's target, as the device last said it, is where a page wants it to be."""
        truth, hand = self.feed.truth, self.hand
        if truth is None or hand.goal is None:
            return False
        there = zip(self.feed.to_world(truth.target), hand.goal, range(self.feed.axes), strict=False)
        return all(abs(place - goal) < THERE for place, goal, _ in there)

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
        if self.workspace is None:
            return Limits(((-0.5, 0.5),) * 2 + ((-100.0, 100.0),), *self._speeds)
        ends = tuple((low + EDGE * (high - low), high - EDGE * (high - low)) for low, high in self.workspace)
        return Limits(ends, *self._speeds)

    async def do(self, wish: dict, page) -> str:
        """Does it for a page; returns the sentence that says what was done, "" if there is nothing to say."""
        self._leader = page if wish["do"] in LEADING else self._leader
        return await self._does[wish["do"]](wish)

    async def poll(self) -> None:
        """Asks the nodes for their parameters; nodes that are not heard any more keep none."""
        for node, declared in tuned.NODES.items():
            try:
                self.values[node] = await self.services.get(node, [parameter.name for parameter in declared])
            except ValueError:
                if node not in self.feed.statuses:
                    self.values.pop(node, None)
        named = self.values.get(DRIVER, self.values.get(LOOPBACK, {})).get("device")
        if named and named != self._asked_device:
            self._asked_device = named
            self._describe(named)

    def lead(self, now: float) -> None:
        """Leads the hand on towards its goal, or lets go when the page that led it is silent; to be called often. now
        [s]."""
        if not self.feed.axes:
            self.hand.release()
            return
        truth, to_world = self.feed.truth, self.feed.to_world
        self.hand.listen(now, self._leader.heard if self._leader else 0)
        place = self.hand.lead(now, self.limits)
        if self.hand.loose:
            place = self.hand.give_in(now, to_world(truth.position), to_world(truth.target))
        if place is not None:
            axes = AXES[: self.feed.axes]
            self._target.publish(JointState(name=list(axes), position=list(place[: len(axes)])))

    def _prepare(self):
        """Clients before they are needed: an e-stop must not wait for its service to be found."""
        for service in wishes.TRIGGERS:
            self.services.prepare(Trigger, f"{DRIVER}/{service}")
        for service in ("load_scene", "reset_scene"):
            self.services.prepare(Trigger, f"{SIMULATION}/{service}")
        for node in tuned.NODES:
            self.services.prepare(GetParameters, f"{node}/get_parameters")
            self.services.prepare(SetParametersAtomically, f"{node}/set_parameters_atomically")
        self.services.prepare(GetState, f"{RECORDER}/get_state")
        self.services.prepare(ChangeState, f"{RECORDER}/change_state")

    def _describe(self, name):
        try:
            self.device, self.problem = load_device(name), ""
            self.feed.scale = self.device.scale
        except (ValueError, OSError) as error:
            self.device, self.problem = None, f"the device's workspace is not known: {error}"

    async def _aim(self, wish):
        return self.aim({axis: wish[axis] for axis in AXES if axis in wish})

    def aim(self, wish: dict[str, float]) -> str:
        """Where the hand shall go [m, m, rad]; returns the hint if it was clamped. ValueError if there is no hand."""
        if not self.feed.axes:
            raise ValueError("no simulated hand is heard of: haptic_loopback does not run")
        motion = self.values.get(LOOPBACK, {}).get("motion.name", "follow")
        if motion != "follow":
            raise ValueError(f"the hand plays the script {motion}; start haptic_loopback with motion.name: follow")
        now = time.monotonic()
        if self.hand.goal is None:
            self.hand.take(tuple(self.feed.to_world(self.feed.truth.target)), now)
        hint = self.hand.aim(wish, self.limits)
        self.lead(now)
        return hint

    async def _trigger(self, wish):
        if wish["service"] not in wishes.TRIGGERS:
            raise ValueError(f"{wish['service']} is none of {', '.join(wishes.TRIGGERS)}")
        if wish["service"] != "reset":
            self.held_off = wish["service"] != "enable"
        return await self.order(wish["service"])

    async def order(self, service: str) -> str:
        """enable, disable, estop or reset of the driver. Only what stops is asked for again and again: a late second
        request to go would undo a stop that came after the first."""
        again = () if service in STOPPING else (1, ATTEMPTS * ANSWER)
        return await self.services.trigger(f"{DRIVER}/{service}", *again)

    async def _set(self, wish):
        value = tuned.typed(wish["name"], wish["value"])
        await self.services.set(DRIVER, {wish["name"]: value})
        await self.poll()
        return f"{wish['name']} is {value}"

    async def _mark(self, wish):
        if not self._marks.get_subscription_count():
            raise ValueError("nobody records: the mark is kept nowhere")
        self._marks.publish(String(data=wish["text"]))
        return f"mark set: {wish['text']}"

    async def _record(self, wish):
        state = (await self.services.ask(GetState, f"{RECORDER}/get_state", GetState.Request())).current_state.id
        steps = {UNCONFIGURED: (CONFIGURE, ACTIVATE), INACTIVE: (ACTIVATE,)} if wish["on"] else {ACTIVE: (DEACTIVATE,)}
        for step in steps.get(state, ()):
            request = ChangeState.Request()
            request.transition.id = step
            answer = await self.services.ask(ChangeState, f"{RECORDER}/change_state", request, 1, BAG)
            if not answer.success:
                raise ValueError(f"{RECORDER} refused; its log says why")
        return "recording" if wish["on"] else "the bag is closed"

    async def _restart(self, wish):
        if self._company is None:
            raise ValueError(f"{wish['name']} is fixed once the nodes run; haptic demo --view starts them again for it")
        self.hand.release()
        self.stage.close()
        said = await self._company.change(wish["name"], wish["value"])
        self.feed.statuses.clear()  # of nodes that have ended
        return said
