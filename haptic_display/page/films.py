# SPDX-License-Identifier: Apache-2.0
"""Films of recordings, each made when it is asked for, by a process of its own, one at a time."""

import asyncio
import contextlib
from pathlib import Path

from haptic_device.process import ending_with_us, own_environment, running_module

LEAST_URGENT = ("nice", "-n", "19")  # the servo and the simulation go first


class Films:
    """What is being made when the server stops ends with it."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()

    async def page(self, bag: Path) -> bytes:
        """The page that plays a bag. Raises ValueError with one sentence if it cannot be made."""
        async with self._turn:
            process = await asyncio.create_subprocess_exec(
                *ending_with_us([*LEAST_URGENT, *running_module("haptic_display.page.film"), str(bag)]),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
                env=own_environment(),
                start_new_session=True,
            )
            try:
                page, said = await process.communicate()
            finally:
                if process.returncode is None:
                    with contextlib.suppress(ProcessLookupError):
                        process.kill()
                    await process.wait()
        if process.returncode:
            why = said.decode(errors="replace").strip().split("\n")[-1] or f"it ended with {process.returncode}"
            raise ValueError(f"the film could not be made: {why}")
        return page
