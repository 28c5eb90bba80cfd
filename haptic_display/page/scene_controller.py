# SPDX-License-Identifier: Apache-2.0
"""The simulation's scene and method as pages choose them."""

import asyncio
from collections.abc import Awaitable
from typing import TYPE_CHECKING

from haptic_device.config.files import names
from haptic_device.message_fields import AXES
from haptic_display.page.settings import SIMULATION
from haptic_display.page.waiting import ARRIVAL, until
from haptic_display.service_requests import set_parameters, trigger
from haptic_sim.scene.language import load
from haptic_sim.scene.needs import needs_of

if TYPE_CHECKING:  # it imports this
    from haptic_display.page.commands import CommandHandler

DOING = "the hand goes to where the scene begins"
LOADING = 180.0  # s that a simulation may take to load: a method that nobody has used before is compiled
YIELD = 1.0  # s that a hand that lets go may take to pull at nothing
REST = 0.2  # s that handle and tool are given there


class SceneController:
    """Of a command handler, whose state, hand, questions and values it uses. What pages ask for returns a sentence.

    changing: whether the hand is led to the start of a scene."""

    def __init__(self, commands: "CommandHandler"):
        self._commands, self.changing = commands, False

    async def load(self, name: str) -> str:
        """Another scene."""
        offered = (*names("scenes"), self._commands.values.get(SIMULATION, {}).get("scene"))
        if name not in offered:
            raise ValueError(f"{name} is none of the scenes that the page offers")
        load(name)
        return await self._alone({"scene": name})

    async def choose_method(self, name: str) -> str:
        """The same scene by another method."""
        return await self._alone({"method": name})

    async def start_again(self) -> str:
        """The start of the scene, with the motor on: a fault is cleared. Only a motor that a page has switched off
        without a fault stays off."""
        return await self._alone({}, self._commands.fault)

    async def enter(self, change: dict[str, str], fault: str = "") -> str:
        """What is asked for, of who has the display alone: motor off, the hand to where the scene begins, the scene,
        motor on again; it waits for a small force, and the hand is let go. fault: the one that is cleared."""
        self.changing = True
        try:
            return await self._enter(change, fault)
        finally:
            self.changing = False
            self._commands.let_go()

    async def _alone(self, change: dict[str, str], fault: str = "") -> str:
        with self._commands.alone(DOING):
            if fault:
                self._commands.held_off = False  # what was stopped before; a stop from now on counts
            return await self.enter(change, fault)

    async def _enter(self, change: dict[str, str], fault: str) -> str:
        commands = self._commands
        driven = commands.driving
        await self._let_go()
        if driven:
            await commands.order("disable")
        await self._lead_to_start(change.get("scene"))
        if fault:
            commands.check_wanted(fault)
            await commands.order("reset")
        try:
            said = await self._change(change)
        except ValueError:  # what there was goes on from its start: the tool cannot be far from the hand
            await self._lead_to_start(None)
            await self._quietly(commands.ask(trigger(f"{SIMULATION}/reset_scene")))
            raise
        finally:
            if (driven or fault) and not commands.held_off:
                await self._quietly(commands.order("enable"))
        await commands.poll()
        return said

    async def _let_go(self) -> None:
        """The hand stops pulling while the motor still holds against it: else it would fly off with the motor."""
        self._commands.let_go()
        await until(lambda: self._commands.yielded, YIELD)

    async def _change(self, change: dict[str, str]) -> str:
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

    async def _lead_to_start(self, name: str | None) -> None:
        commands, scene = self._commands, self._commands.state.scene
        try:
            start = needs_of(name).start if name else scene.solids[0].pose  # type: ignore[union-attr]  # caught below
            commands.aim(dict(zip(AXES[: commands.state.axes], map(float, start), strict=False)))
        except (ValueError, TypeError, AttributeError):
            return  # no hand that follows, or no scene, or one that the simulation refuses
        await until(lambda: commands.arrived, ARRIVAL)
        await asyncio.sleep(REST)

    async def _quietly(self, asked: Awaitable[object]) -> None:
        try:
            await asked
        except ValueError:
            return
