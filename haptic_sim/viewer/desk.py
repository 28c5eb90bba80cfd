# SPDX-License-Identifier: Apache-2.0
"""Does what pages ask for: one method a wish. What goes wrong is a ValueError with a sentence for whoever asked."""

import asyncio
import json
import time

from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from std_srvs.srv import Trigger

from haptic_device.device import AXES, Device, load_device
from haptic_device.node.wire import LATEST, TRACE, JointState, String
from haptic_sim.scene import load
from haptic_sim.viewer import tuned, wishes
from haptic_sim.viewer.feed import Feed
from haptic_sim.viewer.hand import Hand, Limits
from haptic_sim.viewer.second import Second
from haptic_sim.viewer.services import Services

DRIVER, LOOPBACK, SIMULATION, RECORDER = "haptic_driver", "haptic_loopback", "haptic_simulation", "haptic_recorder"
UNCONFIGURED, INACTIVE, ACTIVE = 1, 2, 3  # lifecycle states
CONFIGURE, ACTIVATE, DEACTIVATE = 1, 3, 4  # lifecycle transitions
BAG = 3.0  # s that a recorder may take to open or close a bag
READY = 180.0  # s that a second operating point may take to start: the first start compiles
ARRIVAL = 1.5  # s that the hand may take to the place where a scene begins


class Desk:
    """Owns the hand and the services. `values` are the nodes' parameters as last polled: {node: {name: value}}.

    company: the nodes, where they are this process's to start again; else None.
    """

    def __init__(self, node, feed: Feed, speeds: tuple[float, float], company=None):
        self.feed, self.services, self.hand, self._company = feed, Services(node), Hand(), company
        self.values, self.device, self.problem, self.second = {}, None, "", None
        self._speeds, self._asked_device = speeds, None
        self._target = node.create_publisher(JointState, "operator/target", LATEST)
        self._marks = node.create_publisher(String, "mark", TRACE)
        self._prepare()

    @property
    def limits(self) -> Limits:
        """Workspace in the world and speeds; without a description of the device, a workspace of 1 m."""
        if not isinstance(self.device, Device):
            return Limits(((-0.5, 0.5),) * 2 + ((-100.0, 100.0),), *self._speeds)
        length, angle = self.device.scale
        scales = (length, length, angle)
        ends = tuple(
            tuple(scale * end for end in axis.workspace) for axis, scale in zip(self.device.axes, scales, strict=False)
        )
        return Limits(ends, *self._speeds)

    async def do(self, wish: dict) -> str:
        """Does it; returns the sentence that says what was done, "" if there is nothing to say."""
        return await getattr(self, f"_{wish['do']}")(wish)

    async def poll(self) -> None:
        """Asks the nodes for their parameters; nodes that do not answer keep none."""
        for node, declared in tuned.NODES.items():
            try:
                self.values[node] = await self.services.get(node, [parameter.name for parameter in declared])
            except ValueError:
                self.values.pop(node, None)
        named = self.values.get(DRIVER, self.values.get(LOOPBACK, {})).get("device")
        if named and named != self._asked_device:
            self._asked_device = named
            self._describe(named)

    def lead(self, now: float) -> None:
        """Leads the hand on towards its goal; to be called often. now [s]."""
        if not self.feed.axes:
            self.hand.release()
        elif (place := self.hand.lead(now, self.limits)) is not None:
            axes = AXES[: self.feed.axes]
            self._target.publish(JointState(name=list(axes), position=list(place[: len(axes)])))

    def compare(self, now: float) -> dict | None:
        """Moves the second operating point as the hand moves; returns where it is. now [s]."""
        if self.second is None or self.second.latest is None:
            return None
        if self.feed.truth:
            self.second.move(now, self.feed.truth.target)
        return self.second.latest

    def differences(self) -> list | None:
        """(name, value of the running driver, value of the second) of what differs; None without a second."""
        if self.second is None:
            return None
        other, now = self.second.system["driver"], self.values.get(DRIVER, {})
        return [(name, now[name], other[name]) for name in now if name in other and now[name] != other[name]]

    def close(self) -> None:
        """Ends what this process has started."""
        if self.second is not None:
            self.second.close()
            self.second = None

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
        return await self.services.trigger(f"{DRIVER}/{wish['service']}")

    async def _set(self, wish):
        value = tuned.typed(wish["name"], wish["value"])
        await self.services.set(DRIVER, {wish["name"]: value})
        await self.poll()
        return f"{wish['name']} is {value}"

    async def _scene(self, wish):
        load(wish["name"])
        return await self._enter({"scene": wish["name"]})

    async def _method(self, wish):
        return await self._enter({"method": wish["name"]})

    async def _start_scene(self, wish):
        return await self._enter({})

    async def _enter(self, change):
        """Motor off, the hand to where the scene begins, the scene, motor on: it waits for a small force by itself."""
        await self._quietly(f"{DRIVER}/disable")
        before = {name: self.values.get(SIMULATION, {}).get(name) for name in change}
        await self._lead_to_start(change.get("scene"))
        if change:
            await self.services.set(SIMULATION, change)
        try:
            said = await self.services.trigger(f"{SIMULATION}/{'load_scene' if change else 'reset_scene'}")
        except ValueError:
            if change and None not in before.values():
                await self.services.set(SIMULATION, before)
            raise
        finally:
            await self._quietly(f"{DRIVER}/enable")
        await self.poll()
        if self.second is not None and change:
            self.close()
        elif self.second is not None:
            self.second.start_again()
        return said

    async def _compare(self, wish):
        self.close()
        if not wish["on"]:
            return "the second operating point has ended"
        self.second = second = Second(self._system())
        end = time.monotonic() + READY
        while second.latest is None and not second.problem and time.monotonic() < end:
            await asyncio.sleep(0.05)
        if second.latest is None:
            self.close()
            raise ValueError(second.problem or f"the second operating point was not ready within {READY:g} s")
        await self._enter({})
        return "both are at the scene's start; now change the running one"

    def _system(self):
        """What a second operating point is made of, as everything is now."""
        there = [node for node in (DRIVER, LOOPBACK, SIMULATION) if node not in self.values]
        if there or self.feed.scene is None or self.device is None:
            raise ValueError(f"{there[0] if there else 'the scene'} is not known: nothing to be compared with")
        scene = self.feed.scene
        return {
            "scene": json.loads(scene.model_dump_json(by_alias=True, exclude_unset=True)),
            "device": self.values[DRIVER]["device"], "driver": self.values[DRIVER], "start": list(scene.tool.pose),
            "loopback": self.values[LOOPBACK], "method": self.feed.said(SIMULATION, "method", "auto"),
            "delay": float(self.feed.said(DRIVER, "age_ms_p50", "1")) * 1e-3,
        }  # fmt: skip

    async def _lead_to_start(self, name):
        scene = load(name) if name else self.feed.scene
        try:
            self.aim(dict(zip(AXES[: self.feed.axes], scene.tool.pose, strict=False)))
        except (ValueError, AttributeError):
            return  # no hand that follows, or no scene
        end = time.monotonic() + ARRIVAL
        while self.hand.sent != self.hand.goal and time.monotonic() < end:
            await asyncio.sleep(0.02)
        await asyncio.sleep(0.2)

    async def _quietly(self, service):
        try:
            await self.services.trigger(service)
        except ValueError:
            return

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
        return await self._company.change(wish["name"], wish["value"])
