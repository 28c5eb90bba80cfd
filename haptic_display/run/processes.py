# SPDX-License-Identifier: Apache-2.0
"""The nodes as child processes: started on the loopback interface alone, watched, stopped in order, never orphaned."""

import contextlib
import itertools
import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from haptic_device import ros_environment
from haptic_device.process import ending_with_us, handling, held, own_environment, running_module, say

NAMESPACE = "/haptic"
TAIL = 4096  # bytes of a log that its last line is looked for in
_PATIENCE = ((signal.SIGINT, 4.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 2.0))  # s after each


class NodeDiedError(RuntimeError):
    """A node ended by itself."""


class Program(NamedTuple):
    """A node to start: its executable's name, Python module, ROS parameters, files of more of them, namespace, and
    topics that it finds under other names. words: the command line of what is no node, which has none of these."""

    name: str
    module: str
    parameters: dict = {}
    files: tuple[Path, ...] = ()
    namespace: str = NAMESPACE
    renamed: dict[str, str] = {}
    words: tuple[str, ...] = ()

    def command(self) -> list[str]:
        """The command line that starts it."""
        if self.words:
            return list(self.words)
        return [*running_module(self.module), *ros_arguments(self.namespace, self.parameters, self.files, self.renamed)]


def ros_arguments(
    namespace: str, parameters: dict, files: tuple[Path, ...] = (), renamed: dict[str, str] | None = None
) -> list[str]:
    """Arguments of a node's main; values in `parameters` go before those in the files. What a node prints is kept by
    who starts it, so that it writes no log of its own. Raises ValueError for what is no namespace."""
    ros_environment.check_namespace(namespace)
    given = [word for file in files for word in ("--params-file", str(file))]
    given += [word for key, value in parameters.items() for word in ("-p", f"{key}:={parameter_text(value)}")]
    given += [word for old, new in (renamed or {}).items() for word in ("-r", f"{old}:={new}")]
    return ["--ros-args", "--disable-external-lib-logs", "-r", f"__ns:={namespace}", *given]


def parameter_text(value) -> str:
    """A value as `-p name:=` and files want it: texts quoted (y is a bool), numbers of a list all doubles if one is."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list | tuple):
        mixed = any(isinstance(item, float) for item in value)
        return "[" + ", ".join(parameter_text(float(item) if mixed else item) for item in value) + "]"
    return repr(value)


class Nodes:
    """The running nodes. As a context: whatever happens inside, none of them is left when it is over."""

    def __init__(self, logs: Path):
        """`logs` is the folder for what each node prints."""
        logs.mkdir(parents=True, exist_ok=True)
        self._logs = logs
        self._running: dict[str, subprocess.Popen] = {}
        self._ends: dict[str, str] = {}  # how they ended, as of the first look

    def __enter__(self) -> "Nodes":
        return self

    def __exit__(self, *exception) -> None:
        self.stop()

    def start(self, program: Program) -> None:
        """Starts one node; it gets a session of its own, so that a terminal's Ctrl-C comes from us, in order."""
        self._ends.pop(program.name, None)
        with open(self._log(program.name), "ab") as log, held():
            command, none, both = ending_with_us(program.command()), subprocess.DEVNULL, subprocess.STDOUT
            there = {**own_environment(), "ROS_LOG_DIR": str(self._logs.absolute()), "PYTHONUNBUFFERED": "1"}
            node = subprocess.Popen(command, stdin=none, stdout=log, stderr=both, env=there, start_new_session=True)
            self._running[program.name] = node

    def check(self) -> dict[str, str]:
        """The last line that each node printed. NodeDiedError if one has ended, which says how."""
        for sentence in self.ended().values():
            raise NodeDiedError(sentence)
        return {name: self.last_line(name) for name in self._running}

    def ended(self) -> dict[str, str]:
        """{name: how} of the nodes that have ended by themselves: by which signal or exit code, and the last error."""
        for name, process in self._running.items():
            if name not in self._ends and (code := process.poll()) is not None:
                self._ends[name] = self._how_it_ended(name, code)
        return {name: self._ends[name] for name in self._running if name in self._ends}

    def pid(self, name: str) -> int:
        """Process id of a running node."""
        return self._running[name].pid

    def last_line(self, name: str) -> str:
        """The last line that the node printed."""
        return next(self._last_lines(name), "it printed nothing")

    def printed(self, name: str) -> str:
        """All that the node printed so far, also when it has ended."""
        return self._log(name).read_text(errors="replace")

    def end(self, name: str) -> bool:
        """Ends one node; False if it had to be killed."""
        return _end(self._running.pop(name))

    def kill(self, name: str) -> None:
        """Ends one node that may hear no signal, if it runs."""
        if process := self._running.pop(name, None):
            process.kill()
            process.wait()

    def stop(self) -> None:
        """Ends all nodes one by one, the last started first; a Ctrl-C meanwhile waits until all have ended."""
        with undisturbed():
            for name in reversed(list(self._running)):
                if not self.end(name):
                    say(f"{name} had to be killed; it heard neither SIGINT nor SIGTERM")

    def end_all_but(self, kept: str) -> None:
        """Ends the others as `stop` does; returns when they have ended."""
        for name in [name for name in reversed(list(self._running)) if name != kept]:
            _end(self._running.pop(name))

    def _how_it_ended(self, name, code):
        how = f"ended with exit code {code}" if code >= 0 else f"was ended by {_signal(-code)}"
        errors = (line.removeprefix(f"{name}: ") for line in self._last_lines(name) if _is_error(line, code < 0))
        return ": ".join((f"{name} {how}", *itertools.islice(errors, 1)))

    def _last_lines(self, name):
        """The last first; none of a log that cannot be read."""
        lines: list[str] = []
        with contextlib.suppress(OSError), open(self._log(name), "rb") as log:
            log.seek(max(0, log.seek(0, os.SEEK_END) - TAIL))
            lines = log.read().decode(errors="replace").split("\n")
        return (line.strip() for line in reversed(lines) if line.strip())

    def _log(self, name: str) -> Path:
        return self._logs / f"{name}.log"


def _end(process: subprocess.Popen) -> bool:
    for number, patience in _PATIENCE:
        if process.poll() is not None:
            return True
        process.send_signal(number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
    return process.returncode != -signal.SIGKILL


def _is_error(line: str, killed: bool) -> bool:
    """Whether a line is an error, or the last words of a node that ended by itself, unless logged as less."""
    return line.startswith(("[ERROR]", "[FATAL]")) or not (killed or line.startswith(("[INFO]", "[WARN]", "[DEBUG]")))


def _signal(number: int) -> str:
    name = signal.Signals(number).name if number in set(signal.Signals) else "a signal"
    return f"{name} (signal {number})"


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Ctrl-C and its like wait until the block is over."""
    heard: list[int] = []
    with handling(lambda number, frame: heard.append(number)):
        yield
    if heard:
        raise KeyboardInterrupt


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """SIGINT, SIGTERM and SIGHUP all arrive as KeyboardInterrupt, so that every end takes the orderly way out."""

    def interrupt(number, frame):
        raise KeyboardInterrupt

    with handling(interrupt):
        yield
