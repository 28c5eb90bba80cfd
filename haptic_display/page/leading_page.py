# SPDX-License-Identifier: Apache-2.0
"""Which page leads the hand: the first to aim, until it lets go or another takes over."""

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # both import this
    from haptic_display.page.commands import CommandHandler
    from haptic_display.page.session import Session


class LeadingPage:
    """Of a command handler, whose hand, guide and state it uses. What pages ask for returns a sentence.

    keeper: the session whose silence lets the hand go: the last to lead it, or to have it led to a scene's start."""

    def __init__(self, commands: "CommandHandler"):
        self._commands = commands
        self.keeper: Session | None = None

    @property
    def heard(self) -> int:
        """Messages so far of the keeper."""
        return self.keeper.heard if self.keeper else 0

    def follow(self, session: "Session | None", place: dict[str, float]) -> str:
        """The hand goes where a page aims. ValueError if it is not there."""
        self.keeper = session
        hint = self._commands.aim(place)
        self._commands.hand.leader = session
        return hint

    def check(self, session: "Session | None") -> None:
        """ValueError if another page leads the hand."""
        if self._commands.hand.leader not in (None, session):
            raise ValueError("another page leads the hand: press Take over")

    def let_go(self, session: "Session | None") -> str:
        """The hand lets go, unless another page leads it, or it is led to where it must be."""
        commands = self._commands
        if commands.hand.leader in (None, session):
            commands.guide.stop()
            if not commands.doing:
                commands.let_go()
        return ""

    def take_over(self, session: "Session | None") -> str:
        """The hand stays where it is, and is this page's. ValueError if there is none."""
        commands = self._commands
        if not commands.state.axes or (truth := commands.state.truth) is None:
            raise ValueError("no simulated hand is heard of: haptic_loopback does not run")
        commands.hand.take(commands.state.to_world(truth.target), time.monotonic())
        self.keeper = commands.hand.leader = session
        return "this page leads the hand"
