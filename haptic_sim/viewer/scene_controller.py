# SPDX-License-Identifier: Apache-2.0
"""The simulation's scene and method as pages choose them."""

import asyncio
import time

from haptic_device.config_files import names
from haptic_device.description import AXES
from haptic_sim.scene.drawing import drawing_of
from haptic_sim.scene.language import load
from haptic_sim.service_requests import set_parameters, trigger
from haptic_sim.viewer.settings import SIMULATION

LOADING = 180.0  # s that a simulation may take to load: a method that nobody has used before is compiled
ARRIVAL = 10.0  # s that the hand may take to the place where a scene begins
YIELD = 1.0  # s that a hand that lets go may take to pull at nothing
REST = 0.2  # s that handle and tool are given there


class SceneController:
    """Of a command handler, whose state, hand, questions and values it uses. What pages ask for returns a sentence."""

    def __init__(self, commands):
        self._commands, self._changing = commands, asyncio.Lock()

    @property
    def changing(self) -> bool:
        """Whether the hand is led to the start of a scene, and none but this may lead it."""
        return self._changing.locked()

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
        """The start of the scene, with the motor on: a fault is cleared. Only a motor that a page has switched off
        without a fault stays off."""
        return await self._enter({}, self._commands.faulty)

    async def _enter(self, change, repairing=False):
        """Motor off, the hand to where the scene begins, the scene, motor on again; it waits for a small force."""
        if self.changing:
            raise ValueError("the scene is being changed already")
        async with self._changing:
            driven = self._commands.driving
            if repairing:
                self._commands.held_off = False  # what was stopped before; a stop from now on counts
            await self._let_go()
            if driven:
                await self._commands.order("disable")
            await self._lead_to_start(change.get("scene"))
            if repairing:
                await self._clear()
            try:
                said = await self._change(change)
            except ValueError:  # what there was goes on from its start: the tool cannot be far from the hand
                await self._lead_to_start(None)
                await self._quietly(self._commands.ask(trigger(f"{SIMULATION}/reset_scene")))
                raise
            finally:
                if (driven or repairing) and not self._commands.held_off:
                    await self._quietly(self._commands.order("enable"))
            await self._commands.poll()
        return said

    async def _let_go(self):
        """The hand stops pulling while the motor still holds against it: else it would fly off with the motor."""
        self._commands.let_go()
        end = time.monotonic() + YIELD
        while not self._commands.yielded and time.monotonic() < end:
            await asyncio.sleep(0.02)

    async def _clear(self):
        if self._commands.held_off:
            raise ValueError("stopped again while the hand went to the start")
        await self._commands.order("reset")

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
        scene = drawing_of(load(name)) if name else commands.state.scene
        try:
            commands.aim(dict(zip(AXES[: commands.state.axes], scene.solids[0].pose, strict=False)))
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
