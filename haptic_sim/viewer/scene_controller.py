# SPDX-License-Identifier: Apache-2.0
"""The simulation's scene and method as pages choose them, and a second operating point beside the running one."""

import asyncio
import json
import math
import time

from haptic_device.config_files import names
from haptic_device.description import AXES
from haptic_device.status import number
from haptic_sim.scene.language import load
from haptic_sim.service_requests import set_parameters, trigger
from haptic_sim.viewer.settings import DRIVER, LOOPBACK, SIMULATION
from haptic_sim.viewer.shadow_simulation import ShadowSimulation

READY = 180.0  # s that a second operating point may take to start: the first start compiles
LOADING = 180.0  # s that a simulation may take to load: a method that nobody has used before is compiled
ARRIVAL = 10.0  # s that the hand may take to the place where a scene begins
REST = 0.2  # s that handle and tool are given there


class SceneController:
    """Of a command handler, whose state, hand, questions and values it uses. What pages ask for returns a sentence."""

    def __init__(self, commands):
        self._commands, self._shadow, self._changing = commands, None, asyncio.Lock()

    async def load(self, name: str) -> str:
        """Another scene."""
        offered = (*names("scenes"), self._commands.values.get(SIMULATION, {}).get("scene"))
        if name not in offered:
            raise ValueError(f"{name} is none of the scenes that the page offers")
        load(name)
        return await self._enter({"scene": name})

    async def choose_method(self, name: str) -> str:
        """The same scene by another method."""
        return await self._enter({"method": name})

    async def start_again(self) -> str:
        """The start of the scene."""
        return await self._enter({})

    async def compare(self, on: bool) -> str:
        """Begins or ends a second operating point with the present settings; both begin where the scene does."""
        await self.close()
        if not on:
            return "the second operating point has ended"
        await self._commands.poll()  # nodes that have just started again are asked first
        system = self.system()
        await self.close()  # of another page that has asked for one meanwhile
        self._shadow = shadow = ShadowSimulation(system)
        end = time.monotonic() + READY
        while self._shadow is shadow and shadow.latest is None and not shadow.problem and time.monotonic() < end:
            await asyncio.sleep(0.05)
        if self._shadow is not shadow:
            raise ValueError("the second operating point was ended meanwhile")
        if shadow.latest is None:
            await self.close()
            raise ValueError(shadow.problem or f"the second operating point was not ready within {READY:g} s")
        await self._enter({})
        return "both are at the scene's start; now change the running one"

    def follow(self, now: float) -> dict | None:
        """Moves the second operating point as the hand moves; returns where it is. now [s]."""
        if self._shadow is None or self._shadow.latest is None:
            return None
        if truth := self._commands.state.truth:
            self._shadow.move(now, truth.target)
        return self._shadow.latest

    def comparison(self) -> dict | None:
        """differences: (name, value of the running driver, value of the second) of what differs; note: a sentence if
        the second does not show what it should. None without a second."""
        if self._shadow is None:
            return None
        other, now = self._shadow.system["driver"], self._commands.values.get(DRIVER, {})
        differing = [(name, now[name], other[name]) for name in now if name in other and now[name] != other[name]]
        return {"differences": differing, "note": self._shadow.note}

    async def close(self) -> None:
        """Ends the second operating point, if there is one."""
        while (shadow := self._shadow) is not None:
            self._shadow = None
            await shadow.close()

    async def _enter(self, change):
        """Motor off, the hand to where the scene begins, the scene, motor on again; it waits for a small force."""
        if self._changing.locked():
            raise ValueError("the scene is being changed already")
        async with self._changing:
            driven = self._commands.driving
            if driven:
                await self._commands.order("disable")
            await self._lead_to_start(change.get("scene"))
            try:
                said = await self._change(change)
            except ValueError:  # what there was goes on from its start: the tool cannot be far from the hand
                await self._lead_to_start(None)
                await self._quietly(self._commands.ask(trigger(f"{SIMULATION}/reset_scene")))
                raise
            finally:
                if driven and not self._commands.held_off:
                    await self._quietly(self._commands.order("enable"))
            await self._commands.poll()
        if change:
            await self.close()
        elif self._shadow is not None:
            self._shadow.start_again()
        return said

    async def _change(self, change):
        """Has the simulation load, with these parameters, or begin again; parameters that it cannot load are undone."""
        ask = self._commands.ask
        if not change:
            return await ask(trigger(f"{SIMULATION}/reset_scene"))
        before = {name: self._commands.values.get(SIMULATION, {}).get(name) for name in change}
        await ask(set_parameters(SIMULATION, change))
        try:
            return await ask(trigger(f"{SIMULATION}/load_scene"), LOADING, None)
        except ValueError:
            if None not in before.values():
                await ask(set_parameters(SIMULATION, before))
            raise

    async def _lead_to_start(self, name):
        commands = self._commands
        scene = load(name) if name else commands.state.scene
        try:
            commands.aim(dict(zip(AXES[: commands.state.axes], scene.tool.pose, strict=False)))
        except (ValueError, AttributeError):
            return  # no hand that follows, or no scene
        end = time.monotonic() + ARRIVAL
        while not commands.arrived and time.monotonic() < end:
            await asyncio.sleep(0.02)
        await asyncio.sleep(REST)

    async def _quietly(self, asked):
        try:
            await asked
        except ValueError:
            return

    def system(self) -> dict:
        """What a second operating point is made of (ShadowSystem), as everything is now; ValueError if one thing is
        not known."""
        state, values = self._commands.state, self._commands.values
        lacking = [node for node in (DRIVER, LOOPBACK, SIMULATION) if node not in values]
        if lacking or state.scene is None or self._commands.device is None:
            raise ValueError(f"{lacking[0] if lacking else 'the scene'} is not known: nothing to be compared with")
        age = number(state.said(DRIVER, "age_ms_p50"))  # [ms]; none is known before a tool has answered
        return {
            "scene": json.loads(state.scene.model_dump_json(by_alias=True, exclude_unset=True)),
            "device": values[DRIVER]["device"],
            "driver": values[DRIVER],
            "loopback": values[LOOPBACK],
            "simulation": values[SIMULATION],
            "method": state.said(SIMULATION, "method", "auto"),
            "start": list(state.scene.tool.pose),
            "delay": 1e-3 * (age if 0.0 <= age < math.inf else 1.0),
        }
