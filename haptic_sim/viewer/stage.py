# SPDX-License-Identifier: Apache-2.0
"""What is on stage: the simulation's scene and method, and a second operating point beside the running one."""

import asyncio
import json
import math
import time

from haptic_device.config_files import names
from haptic_device.description import AXES
from haptic_device.status import number
from haptic_sim.scene import load
from haptic_sim.viewer.second import Second

DRIVER, LOOPBACK, SIMULATION = "haptic_driver", "haptic_loopback", "haptic_simulation"
READY = 180.0  # s that a second operating point may take to start: the first start compiles
LOADING = 180.0  # s that a simulation may take to load: a method that nobody has used before is compiled
ARRIVAL = 10.0  # s that the hand may take to the place where a scene begins
REST = 0.2  # s that handle and tool are given there


class Stage:
    """Of a desk, whose feed, hand, services and values it uses. Wishes are methods: async (wish) → sentence."""

    def __init__(self, desk):
        self._desk, self._second, self._changing = desk, None, asyncio.Lock()

    async def load(self, wish: dict) -> str:
        """Another scene."""
        offered = (*names("scenes"), self._desk.values.get(SIMULATION, {}).get("scene"))
        if wish["name"] not in offered:
            raise ValueError(f"{wish['name']} is none of the scenes that the page offers")
        load(wish["name"])
        return await self._enter({"scene": wish["name"]})

    async def take_method(self, wish: dict) -> str:
        """The same scene by another method."""
        return await self._enter({"method": wish["name"]})

    async def start_again(self, wish: dict) -> str:
        """The start of the scene."""
        return await self._enter({})

    async def set_beside(self, wish: dict) -> str:
        """Begins or ends a second operating point with the present settings; both begin where the scene does."""
        self.close()
        if not wish["on"]:
            return "the second operating point has ended"
        await self._desk.poll()  # nodes that have just started again are asked first
        self._second = second = Second(self._system())
        end = time.monotonic() + READY
        while self._second is second and second.latest is None and not second.problem and time.monotonic() < end:
            await asyncio.sleep(0.05)
        if self._second is not second:
            raise ValueError("the second operating point was ended meanwhile")
        if second.latest is None:
            self.close()
            raise ValueError(second.problem or f"the second operating point was not ready within {READY:g} s")
        await self._enter({})
        return "both are at the scene's start; now change the running one"

    def go_along(self, now: float) -> dict | None:
        """Moves the second operating point as the hand moves; returns where it is. now [s]."""
        if self._second is None or self._second.latest is None:
            return None
        if truth := self._desk.feed.truth:
            self._second.move(now, truth.target)
        return self._second.latest

    def beside(self) -> dict | None:
        """differences: (name, value of the running driver, value of the second) of what differs; note: a sentence if
        the second does not show what it should. None without a second."""
        if self._second is None:
            return None
        other, now = self._second.system["driver"], self._desk.values.get(DRIVER, {})
        differing = [(name, now[name], other[name]) for name in now if name in other and now[name] != other[name]]
        return {"differences": differing, "note": self._second.note}

    def close(self) -> None:
        """Ends the second operating point, if there is one."""
        if self._second is not None:
            self._second.close()
            self._second = None

    async def _enter(self, change):
        """Motor off, the hand to where the scene begins, the scene, motor on again; it waits for a small force."""
        if self._changing.locked():
            raise ValueError("the scene is being changed already")
        async with self._changing:
            driven = self._desk.driving
            if driven:
                await self._desk.order("disable")
            await self._lead_to_start(change.get("scene"))
            try:
                said = await self._change(change)
            except ValueError:  # what there was goes on from its start: the tool cannot be far from the hand
                await self._lead_to_start(None)
                await self._quietly(self._desk.services.trigger(f"{SIMULATION}/reset_scene"))
                raise
            finally:
                if driven and not self._desk.held_off:
                    await self._quietly(self._desk.order("enable"))
            await self._desk.poll()
        if self._second is not None and change:
            self.close()
        elif self._second is not None:
            self._second.start_again()
        return said

    async def _change(self, change):
        """Has the simulation load, with these parameters, or begin again; parameters that it cannot load are undone."""
        services = self._desk.services
        if not change:
            return await services.trigger(f"{SIMULATION}/reset_scene")
        before = {name: self._desk.values.get(SIMULATION, {}).get(name) for name in change}
        await services.set(SIMULATION, change)
        try:
            return await services.trigger(f"{SIMULATION}/load_scene", 1, LOADING)
        except ValueError:
            if None not in before.values():
                await services.set(SIMULATION, before)
            raise

    async def _lead_to_start(self, name):
        desk = self._desk
        scene = load(name) if name else desk.feed.scene
        try:
            desk.aim(dict(zip(AXES[: desk.feed.axes], scene.tool.pose, strict=False)))
        except (ValueError, AttributeError):
            return  # no hand that follows, or no scene
        end = time.monotonic() + ARRIVAL
        while not desk.arrived and time.monotonic() < end:
            await asyncio.sleep(0.02)
        await asyncio.sleep(REST)

    async def _quietly(self, asked):
        try:
            await asked
        except ValueError:
            return

    def _system(self):
        """What a second operating point is made of, as everything is now."""
        feed, values = self._desk.feed, self._desk.values
        lacking = [node for node in (DRIVER, LOOPBACK, SIMULATION) if node not in values]
        if lacking or feed.scene is None or self._desk.device is None:
            raise ValueError(f"{lacking[0] if lacking else 'the scene'} is not known: nothing to be compared with")
        age = number(feed.said(DRIVER, "age_ms_p50"))  # [ms]; none is known before a tool has answered
        return {
            "scene": json.loads(feed.scene.model_dump_json(by_alias=True, exclude_unset=True)),
            "device": values[DRIVER]["device"],
            "driver": values[DRIVER],
            "loopback": values[LOOPBACK],
            "simulation": values[SIMULATION],
            "method": feed.said(SIMULATION, "method", "auto"),
            "start": list(feed.scene.tool.pose),
            "delay": 1e-3 * (age if 0.0 <= age < math.inf else 1.0),
        }
