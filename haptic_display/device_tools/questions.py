# SPDX-License-Identifier: Apache-2.0
"""Who answers what a set-up asks: somebody at a terminal, or a file."""

import math
import select
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TextIO

from haptic_device.config.yaml_reader import load

YES, NO = ("y", "yes"), ("n", "no", "")


class Questions(Protocol):
    """The answers by key, such as x.length; a question that cannot be answered is a ValueError."""

    def say(self, sentence: str) -> None:
        """Tells what was found or what goes wrong."""

    def known(self, key: str) -> Any:
        """What is known beforehand and need not be measured, or None."""

    def ready(self, key: str, todo: str, look: Callable[[], object]) -> None:
        """Returns when it is done; look() is called again and again meanwhile."""

    def number(self, key: str, text: str, unit: str) -> float:
        """A finite number in this unit."""

    def yes(self, key: str, text: str) -> bool:
        """Whether it may be, or is so."""

    def choice(self, key: str, text: str, options: tuple[str, ...]) -> str:
        """One of the options."""


class Terminal:
    """Asks on standard output, reads standard input; what it cannot use it asks again. EOFError at its end."""

    def __init__(self, source: TextIO | None = None, target: TextIO | None = None):
        self._source, self._target = source or sys.stdin, target or sys.stdout

    def say(self, sentence: str) -> None:
        print(sentence, file=self._target, flush=True)

    def known(self, key: str) -> Any:
        return None

    def ready(self, key: str, todo: str, look: Callable[[], object]) -> None:
        self._ask(f"{todo}, then press Enter: ")
        while not select.select([self._source], [], [], 0.0)[0]:
            look()
        self._line()

    def number(self, key: str, text: str, unit: str) -> float:
        while True:
            self._ask(f"{text} [{unit}]: ")
            typed = self._line()
            try:
                return _finite(float(typed))
            except ValueError:
                self.say(f"that is {typed!r}; a number in {unit} is needed")

    def yes(self, key: str, text: str) -> bool:
        while True:
            self._ask(f"{text} [y/N] ")
            typed = self._line().lower()
            if typed in YES or typed in NO:
                return typed in YES
            self.say(f"that is {typed!r}; y or n is needed")

    def choice(self, key: str, text: str, options: tuple[str, ...]) -> str:
        while True:
            self._ask(f"{text} ({' or '.join(options)}): ")
            typed = self._line()
            if typed in options:
                return typed
            self.say(f"that is {typed!r}; {' or '.join(options)} is needed")

    def _ask(self, text: str) -> None:
        print(text, end="", file=self._target, flush=True)

    def _line(self) -> str:
        if not (line := self._source.readline()):
            raise ValueError("standard input has ended before all was asked")
        return line.strip()


class Answers:
    """Of a mapping, or a YAML file: keys within keys, `x: {counts_per_unit: 20000.0}`. Nothing is measured by hand."""

    def __init__(self, content: dict[str, Any], source: str = "answers"):
        self._content, self._source = content, source

    @classmethod
    def read(cls, file: Path) -> "Answers":
        """Of a file. Raises ConfigError."""
        return cls(load(file), str(file))

    def say(self, sentence: str) -> None:
        """Nobody listens."""

    def known(self, key: str) -> Any:
        found: Any = self._content
        for name in key.split("."):
            found = found.get(name) if isinstance(found, dict) else None
        return found

    def ready(self, key: str, todo: str, look: Callable[[], object]) -> None:
        raise ValueError(f"{self._source} does not tell all, and nobody is there to {todo[0].lower() + todo[1:]}")

    def number(self, key: str, text: str, unit: str) -> float:
        found = self._told(key)
        if isinstance(found, bool) or not isinstance(found, int | float) or not math.isfinite(found):
            raise ValueError(f"{self._source}: {key} is {found!r}; a number in {unit} is needed")
        return float(found)

    def yes(self, key: str, text: str) -> bool:
        found = self.known(key)
        if not isinstance(found, bool | None):
            raise ValueError(f"{self._source}: {key} is {found!r}; true or false is needed")
        return bool(found)

    def choice(self, key: str, text: str, options: tuple[str, ...]) -> str:
        found = self._told(key)
        if found not in options:
            raise ValueError(f"{self._source}: {key} is {found!r}; {' or '.join(options)} is needed")
        return found

    def _told(self, key: str) -> Any:
        if (found := self.known(key)) is None:
            raise ValueError(f"{self._source} does not tell {key}")
        return found


def _finite(number: float) -> float:
    if not math.isfinite(number):
        raise ValueError
    return number
