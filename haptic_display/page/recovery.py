# SPDX-License-Identifier: Apache-2.0
"""The one button of the banner: does what a trouble needs, until the display is engaged again. A stop ends it."""

import asyncio
import time
from collections.abc import Collection
from typing import TYPE_CHECKING

from haptic_device.message_fields import AXES
from haptic_display.page.settings import DRIVER, RECORDER, SIMULATION
from haptic_display.page.trouble import NAMES, Trouble, named
from haptic_display.page.waiting import ARRIVAL, STARTING, until

if TYPE_CHECKING:  # they import this, or what it can do without
    from haptic_display.page.commands import CommandHandler
    from haptic_display.page.node_manager import NodeManager

DOING = "what the banner says is being done"
STOPS = ("estop", "device_estop")  # faults that somebody has asked for
READY = 3.0  # s that a driver may take to find its device, or a device to answer
RETRY = 0.2  # s
ENGAGING = 1.5  # s for the display to engage where the handle is
AT_START = 10.0  # s for the display to engage where the scene begins


class Recovery:
    """Of a command handler, whose hand, orders and scenes it uses. nodes: as of the handler."""

    def __init__(self, commands: "CommandHandler", nodes: "NodeManager | None" = None):
        self._commands, self._nodes = commands, nodes

    @property
    def running(self) -> bool:
        """Whether it is at work."""
        return self._commands.doing == DOING

    async def mend(self, trouble: Trouble | None, title: str) -> str:
        """Ends the trouble, which must have this title; returns what was done. ValueError if it cannot be ended, or is
        another, with the reason."""
        if trouble is None:
            return "nothing is wrong"
        if trouble.title != title:
            raise ValueError(f"something else is wrong by now: {trouble.title}")
        with self._commands.alone(DOING):
            if trouble.nodes:
                return await self._mend_nodes(trouble.nodes)
            self._commands.held_off = False  # what was stopped before; a stop from now on counts
            return await self._engage(trouble.fault)

    async def _mend_nodes(self, names: Collection[str]) -> str:
        """A motor that was off before stays off, and who has stopped the display is not overruled."""
        commands = self._commands
        await self._start_again(names)
        off = commands.held_off or not commands.drove or commands.fault in STOPS
        if off or set(names) == {RECORDER}:
            return f"{named(names)} {'run' if len(names) > 1 else 'runs'} again"
        return await self._engage(commands.fault, anew=True)

    async def _start_again(self, names: Collection[str]) -> None:
        if self._nodes is None:
            raise ValueError("these nodes are not the page's to start: start them where they were started")
        commands = self._commands
        commands.hand.release()
        await self._nodes.start_again(names)
        for name in names:
            commands.client.statuses.pop(name, None)  # of the node that is gone
            commands.client.heard.pop(name, None)
        commands.state.look()
        heard = [name for name in names if name in NAMES]
        await until(lambda: all(name in commands.state.statuses for name in heard), STARTING)
        for name in heard:
            if name not in commands.state.statuses:
                raise ValueError(f"the {NAMES[name]} was started, and says nothing yet: wait, and press again")
        await commands.poll()

    async def _engage(self, fault: str, anew: bool = False) -> str:
        """fault: the one that may be cleared; anew: with nodes that were started again, so that the scene begins again
        too."""
        commands = self._commands
        begin_again = SIMULATION in commands.state.statuses
        try:
            await self._lead_inside()
            await self._clear(fault)
            commands.check_wanted(fault)
            if anew and begin_again:
                await commands.scenes.enter({})
                commands.check_wanted(fault)
            await commands.order("enable")
            if await self._engaged(AT_START if anew else ENGAGING):
                return "engaged"
            if begin_again and commands.state.axes and not anew:
                commands.check_wanted("")
                await commands.scenes.enter({})
                if await self._engaged(AT_START):
                    return "engaged at the start of the scene"
            return "enabled: lead the handle to the tool"
        finally:
            commands.let_go()

    async def _clear(self, fault: str) -> str:
        """Clears the fault; a driver or a device that has just begun may need a moment."""
        end = time.monotonic() + READY
        while True:
            self._commands.check_wanted(fault)
            try:
                return await self._commands.order("reset")
            except ValueError:
                if time.monotonic() > end:
                    raise
            await asyncio.sleep(RETRY)

    async def _lead_inside(self) -> None:
        """A simulated hand goes to where the handle may be, no farther than it must; a person's is their own."""
        commands = self._commands
        if not commands.state.axes or (truth := commands.state.truth) is None:
            return
        commands.hand.release()
        try:
            place = commands.state.to_world(truth.position)[: commands.state.axes]
            commands.aim(dict(zip(AXES, place, strict=False)))
        except ValueError:
            return  # it plays a script
        await until(lambda: commands.held_off or (commands.arrived and commands.inside), ARRIVAL)

    async def _engaged(self, patience: float) -> bool:
        """Whether it is within so many seconds. ValueError if it is stopped."""
        commands = self._commands
        engaged = await until(lambda: commands.held_off or commands.state.said(DRIVER, "state") == "engaged", patience)
        if commands.held_off:
            commands.check_wanted("")
        return engaged
