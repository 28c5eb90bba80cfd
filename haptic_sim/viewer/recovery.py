# SPDX-License-Identifier: Apache-2.0
"""The one button of the banner: does what a trouble needs, until the display is engaged again."""

import asyncio
import time

from haptic_device.message_fields import AXES
from haptic_sim.viewer.settings import DRIVER, SIMULATION
from haptic_sim.viewer.trouble import NAMES, RECORDER, Trouble

STARTING = 60.0  # s that a node which is started again may take until it is heard of
READY = 3.0  # s that a driver may take to find its device, or a device to answer
ARRIVAL = 10.0  # s that the hand may take to where the handle may be
ENGAGING = 1.5  # s for the display to engage where the handle is
AT_START = 10.0  # s for the display to engage where the scene begins
LOOK_PERIOD = 0.05  # s


class Recovery:
    """Of a command handler, whose hand, orders and scenes it uses. nodes: as of the handler."""

    def __init__(self, commands, nodes=None):
        self._commands, self._nodes, self._mending = commands, nodes, asyncio.Lock()

    @property
    def running(self) -> bool:
        """Whether it is at work."""
        return self._mending.locked()

    async def mend(self, trouble: Trouble | None) -> str:
        """Ends a trouble; returns what was done. ValueError if it cannot be ended, with the reason."""
        if self.running:
            raise ValueError("it is being done already")
        async with self._mending:
            if trouble is None:
                return "nothing is wrong"
            if trouble.nodes:
                await self._start_again(trouble.nodes)
            if set(trouble.nodes) == {RECORDER}:
                return "the recorder runs again"
            return await self._engage(bool(trouble.nodes))

    async def _start_again(self, names):
        if self._nodes is None:
            raise ValueError("these nodes are not the page's to start: start them where they were started")
        commands = self._commands
        commands.hand.release()
        await self._nodes.start_again(names)
        for name in names:
            commands.client.statuses.pop(name, None)  # of the node that is gone
            commands.client.heard.pop(name, None)
        heard = [name for name in names if name in NAMES]
        await self._until(lambda: all(name in commands.state.statuses for name in heard), STARTING)
        for name in heard:
            if name not in commands.state.statuses:
                raise ValueError(f"the {NAMES[name]} was started, and says nothing yet: wait, and press again")
        await commands.poll()

    async def _engage(self, anew):
        """anew: with nodes that were started again, so that the scene begins again too."""
        commands = self._commands
        await self._lead_inside()
        await self._reset()
        begin_again = SIMULATION in commands.state.statuses
        if anew and begin_again:
            await commands.scenes.start_again()
        commands.held_off = False
        await commands.order("enable")
        if await self._until(self._engaged, AT_START if anew else ENGAGING):
            return "engaged"
        if begin_again and commands.state.axes and not anew:
            await commands.scenes.start_again()
            if await self._until(self._engaged, AT_START):
                return "engaged at the start of the scene"
        return "enabled: lead the handle to the tool"

    async def _reset(self):
        """Clears the fault; a driver or a device that has just begun may need a moment."""
        end = time.monotonic() + READY
        while True:
            try:
                return await self._commands.order("reset")
            except ValueError:
                if time.monotonic() > end:
                    raise
            await asyncio.sleep(4 * LOOK_PERIOD)

    async def _lead_inside(self):
        """A simulated hand goes to where the handle may be, no farther than it must; a person's is their own."""
        commands = self._commands
        if not commands.state.axes:
            return
        commands.hand.release()
        try:
            place = commands.state.to_world(commands.state.truth.position)[: commands.state.axes]
            commands.aim(dict(zip(AXES, place, strict=False)))
        except ValueError:
            return  # it plays a script
        await self._until(lambda: commands.arrived and commands.inside, ARRIVAL)

    async def _until(self, condition, patience):
        end = time.monotonic() + patience
        while time.monotonic() < end and not condition():
            await asyncio.sleep(LOOK_PERIOD)
        return condition()

    def _engaged(self):
        return self._commands.state.said(DRIVER, "state") == "engaged"
