# SPDX-License-Identifier: Apache-2.0
"""`haptic demo` as a process, and whether it leaves anything behind."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import waiting
from waiting import LIMIT

from haptic_device.process import ending_with_us
from haptic_device.realtime import shared_memory

ROOT = Path(__file__).resolve().parents[1]
HAPTIC = [sys.executable, "-m", "haptic_display.cli.main"]
SCRIPTS = sorted((ROOT / "scripts").iterdir())
BUSY = ("--params", str(ROOT / "test" / "busy.yaml"))


class Demo:
    """`haptic demo` as a process; what it says goes into files."""

    def __init__(self, folder: Path, *options: str, scene: str | None = "peg_in_hole"):
        self.out, self._folder = folder / "run", folder
        command = [*HAPTIC, "demo", *(["--scene", scene] if scene else []), "--out", str(self.out), *options]
        with open(folder / "stdout", "wb") as stdout, open(folder / "stderr", "wb") as stderr:
            self.process = subprocess.Popen(ending_with_us(command), cwd=ROOT, stdout=stdout, stderr=stderr)

    @property
    def bag(self) -> Path:
        return self.out / "bag"

    @property
    def said(self) -> str:
        return (self._folder / "stdout").read_text()

    @property
    def progress(self) -> str:
        return (self._folder / "stderr").read_text()

    def ended(self) -> int:
        """Its exit code, when it has ended."""
        return waiting.exit_code(self.process, lambda: self.progress)


@contextlib.contextmanager
def demos(folder):
    """start(*options) starts one in this folder; afterwards it and its nodes have ended."""
    started = []

    def start(*options: str, **given) -> Demo:
        started.append(Demo(folder, *options, **given))
        return started[-1]

    try:
        yield start
    finally:
        for each in started:
            end(each.process)


def end(process: subprocess.Popen) -> None:
    """A demo that is interrupted ends its nodes; nodes of one that was killed end with it."""
    for number in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            process.send_signal(number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(LIMIT)


def pages() -> list[str]:
    """Shared memory of displays in this domain."""
    return [path.name for path in shared_memory.FOLDER.glob(f"haptic_display.{os.environ['ROS_DOMAIN_ID']}.*")]


def children(process: subprocess.Popen) -> list[psutil.Process]:
    """Its nodes; what a node itself asks for a moment, such as git, is none."""
    try:
        return psutil.Process(process.pid).children()
    except psutil.NoSuchProcess:
        return []


def running(processes):
    """Those that still run; one that has ended may wait as a zombie for somebody to ask how."""
    found = []
    for each in processes:
        with contextlib.suppress(psutil.NoSuchProcess):
            found += [each] if each.status() != psutil.STATUS_ZOMBIE else []
    return found
