# SPDX-License-Identifier: Apache-2.0
"""Shows with the simulated hand how a scene's task is done, until somebody does something else."""

import time

from haptic_sim.viewer.messages import AXES
from haptic_sim.viewer.playback import PAUSED, PLAYING, Playback
from haptic_sim.viewer.settings import DRIVER


class Guide:
    """Of a command handler, whose hand and scenes it uses. `playback`: of the scene's suggested way."""

    def __init__(self, commands):
        self._commands, self.playback, self._beginning = commands, Playback(), None

    @property
    def said(self) -> dict[str, str | float | bool]:
        """What pages are told of it: state (off, starting, playing, paused), share of the way, whether it is slow."""
        state = self.playback.state if self._beginning is None else "starting"
        return {"state": state, "share": self.playback.share, "slow": self.playback.slow}

    async def do(self, act: str) -> str:
        """play, pause, step, slow or fast. ValueError where there is no hand, no scene or no way."""
        playback = self.playback
        if act in ("slow", "fast"):
            playback.slow = act == "slow"
        elif act == "pause":
            playback.pause()
        elif self._beginning is None and (playback.state in (PLAYING, PAUSED) or await self._begin()):
            self._commands.aim({})  # takes the hand, if it has been let go
            (playback.step if act == "step" else playback.go_on)(time.monotonic())
        return ""

    def stop(self) -> None:
        """Somebody does something else with the hand."""
        self._beginning = None
        self.playback.stop()

    def lead(self, now: float) -> None:
        """Gives the hand its next goal; to be called often. now [s]."""
        if self.playback.state != PLAYING:
            return
        commands = self._commands
        if commands.hand.goal is None or commands.state.said(DRIVER, "state") == "fault":
            self.stop()
            return
        place = self.playback.place(now)
        commands.hand.aim(dict(zip(AXES[: commands.state.axes], place, strict=False)), commands.limits)

    async def _begin(self):
        """From the scene's start, to which the hand is led first; False if somebody has done something else then."""
        commands, scene = self._commands, self._commands.state.scene
        if scene is None:
            raise ValueError("there is no scene whose way could be shown")
        commands.aim({})  # refuses where no hand follows
        beginning = self._beginning = object()
        try:
            await commands.scenes.start_again()
        finally:
            undisturbed = self._beginning is beginning
            self._beginning = None if undisturbed else self._beginning
        if undisturbed:
            self.playback.begin(scene.way, scene.seconds)
        return undisturbed
