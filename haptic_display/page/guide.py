# SPDX-License-Identifier: Apache-2.0
"""Shows with the simulated hand how a scene's task is done, until somebody does something else."""

import time
from typing import TYPE_CHECKING

from haptic_device.message_fields import AXES
from haptic_display.page.playback import OFF, PLAYING, Playback

if TYPE_CHECKING:  # it imports this
    from haptic_display.page.commands import CommandHandler


class Guide:
    """Of a command handler, whose hand and scenes it uses. `playback`: of the scene's suggested way."""

    def __init__(self, commands: "CommandHandler"):
        self._commands, self.playback, self._scene = commands, Playback(), 0
        self._beginning: object | None = None

    @property
    def said(self) -> dict[str, str | float | bool]:
        """What pages are told of it: state (off, starting, playing, paused), share of the way, whether it is slow."""
        state = self.playback.state if self._beginning is None else "starting"
        return {"state": state, "share": self.playback.share, "slow": self.playback.slow}

    async def do(self, act: str) -> str:
        """play, pause, step, slow or fast. ValueError where there is no hand, no scene, no way or no force."""
        playback = self.playback
        if act in ("slow", "fast"):
            playback.slow = act == "slow"
        elif act == "pause":
            playback.pause()
        elif playback.state != OFF or await self._begin():
            self._commands.aim({})  # takes the hand, if it has been let go
            (playback.step if act == "step" else playback.go_on)(time.monotonic())
        return ""

    def stop(self) -> None:
        """Somebody does something else with the hand, which is let go."""
        self._beginning = None
        if self.playback.state != OFF:
            self.playback.stop()
            self._commands.let_go()

    def lead(self, now: float) -> None:
        """Gives the hand its next goal; to be called often. It ends at a fault, with another scene, and when the hand
        is let go. now [s]."""
        commands = self._commands
        if self.playback.state == OFF:
            return
        if commands.hand.goal is None or commands.fault or commands.state.scene_number != self._scene:
            self.stop()
        elif self.playback.state == PLAYING:
            place = self.playback.place(now)
            commands.hand.aim(dict(zip(AXES[: commands.state.axes], place, strict=False)), commands.limits)
            if self.playback.state == OFF:
                commands.let_go()

    async def _begin(self) -> bool:
        """From the scene's start, to which the hand is led first; False if somebody has done something else then."""
        commands, scene = self._commands, self._commands.state.scene
        if scene is None:
            raise ValueError("there is no scene whose way could be shown")
        commands.check_wanted("")
        if not commands.driving:
            raise ValueError("the motor is off: press Engage first")
        commands.aim({})  # refuses where no hand follows
        beginning = self._beginning = object()
        try:
            await commands.scenes.start_again()
        finally:
            undisturbed = self._beginning is beginning
            self._beginning = None if undisturbed else self._beginning
        if undisturbed:
            self.playback.begin(scene.way, scene.seconds)
            self._scene = commands.state.scene_number
        return undisturbed
