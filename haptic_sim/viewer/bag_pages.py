# SPDX-License-Identifier: Apache-2.0
"""Reports and films of recordings, made by `haptic report` as a process of its own, one at a time, and kept."""

import asyncio
import contextlib
import time
from pathlib import Path
from typing import NamedTuple

from haptic_device.os_errors import in_words
from haptic_device.process import ending_with_us, own_environment, running_module

FILES = {"report.html": "report", "film.html": "film", "film.gif": "GIF"}
SOON = 0.3  # s that are waited for before a page says that it is being made
LONGEST = 600.0  # s
MOST_WAITING = 4  # that are made or wait for it
LEAST_URGENT = ("nice", "-n", "19")  # the servo and the simulation go first
WAITING = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="1">
<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" content="light dark">
<title>Making the {what}</title></head>
<body><main><h1>Making the {what} …</h1>
<p role="status">{seconds:.0f} s so far. It is shown here when it is done.</p></main></body></html>
"""


class Making(NamedTuple):
    """What is being made: since when [s of time.monotonic], and a task that ends with what was said of it."""

    since: float
    task: asyncio.Task[str]


class BagPages:
    """folder: where the pages are put, each recording's in a folder of its own."""

    def __init__(self, folder: Path):
        self._folder, self._turn = folder, asyncio.Lock()
        self._makings: dict[tuple[Path, ...], Making] = {}

    async def page(self, file: str, bags: list[Path], name: str) -> Path | str:
        """A file of these bags, or the text of a page that comes back for it. Raises LookupError, ValueError."""
        if file not in FILES:
            raise LookupError(f"there is nothing called {file}; there are {', '.join(FILES)}")
        key, folder = tuple(bags), self._folder / name
        if key not in self._makings:
            if sum(not making.task.done() for making in self._makings.values()) >= MOST_WAITING:
                raise ValueError(f"{MOST_WAITING} reports wait to be made already; try again when they are done")
            self._makings[key] = Making(time.monotonic(), asyncio.create_task(self._make(bags, folder)))
        making = self._makings[key]
        await asyncio.wait([making.task], timeout=SOON)
        if not making.task.done():
            return WAITING.format(what=FILES[file], seconds=time.monotonic() - making.since)
        try:
            said = making.task.result()
            if (folder / file).is_file():
                return folder / file
        except OSError as error:
            said = in_words(error)
        self._makings.pop(key, None)  # asked for again, it is tried again
        raise ValueError(f"the {FILES[file]} could not be made: {said}")

    async def stop(self) -> None:
        """Ends what is being made."""
        tasks = [making.task for making in self._makings.values()]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _make(self, bags: list[Path], folder: Path) -> str:
        """Makes all files of these bags; what was said of it."""
        async with self._turn:
            for file in FILES:
                (folder / file).unlink(missing_ok=True)
            words = ["report", *bags, "--film", "--out", folder]
            command = ending_with_us([*LEAST_URGENT, *running_module("haptic_sim.cli.main"), *words])
            process = await asyncio.create_subprocess_exec(
                *command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.DEVNULL,
                stderr=asyncio.subprocess.PIPE,
                env=own_environment(),
                start_new_session=True,
            )
            try:
                _, said = await asyncio.wait_for(process.communicate(), LONGEST)
            except TimeoutError:
                return f"it took more than {LONGEST:.0f} s"
            finally:
                if process.returncode is None:
                    with contextlib.suppress(ProcessLookupError):
                        process.kill()
                    await process.wait()
            lines = said.decode(errors="replace").split("\n")
            return next((line for line in reversed(lines) if line.strip()), f"it ended with {process.returncode}")
